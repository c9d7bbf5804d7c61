"""Developable charts laid out exactly, and the slits that they need."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.seams.hard.unroll import slits, unroll
from circparam.seams.prices import edge_prices
from tests.support import shapes
from tests.support.atlases import energies, surface_of, whole


def slit(shape) -> tuple[np.ndarray, float]:
    """The unrolled layout of a shape with the slits that it needs, without distortion, and their length."""
    surface = surface_of(*shape)
    atlas = whole(surface, edge_prices(surface))
    atlas.cut |= slits(atlas)
    cut_mesh = atlas.cut_mesh()
    uv = unroll(cut_mesh)
    assert energies(cut_mesh, uv) == pytest.approx(np.ones(cut_mesh.n_charts), abs=1e-9)
    return uv, float(surface.edge_lengths[atlas.cut].sum())


@pytest.mark.parametrize(
    ("shape", "length"),
    [
        (shapes.cylinder(around=24, along=6, height=2.0), 2.0),  # one slit from end to end
        (shapes.cube(2), 7.0),  # a tree through all eight corners, along sharp edges
        (shapes.cone(24, 3), np.hypot(1, 1.5)),  # one tip and one boundary, hence one slit
        (shapes.annulus(), 0.0),
        (shapes.grid(5, 5), 0.0),
    ],
)
def test_slits_join_tips_and_boundaries_and_what_is_flat_needs_none(shape, length: float) -> None:
    assert slit(shape)[1] == pytest.approx(length)


def test_a_tube_is_unrolled_to_a_rectangle() -> None:
    uv, _ = slit(shapes.cylinder(around=24, along=6, height=2.0))
    size = np.sort(np.ptp((uv - uv.mean(0)) @ np.linalg.svd(uv - uv.mean(0))[2].T, axis=0))
    assert size == pytest.approx([2.0, 24 * 2 * np.sin(np.pi / 24)], rel=1e-6)


def test_bent_sheets_are_rolled_out_exactly() -> None:
    """Every chart by itself, at whatever scale."""
    strip = shapes.half_cylinder(12, 4, 2.0)
    cone = shapes.cone(16, 4, slit=True)
    both = shapes.join(strip, (cone[0] * 10 + np.array([30.0, 0, 0]), cone[1]))
    cut_mesh = whole(surface_of(*both)).cut_mesh()
    uv = unroll(cut_mesh)
    assert energies(cut_mesh, uv) == pytest.approx([1.0, 1.0], abs=1e-9)
    first = uv[cut_mesh.vertex_chart == 0]
    diagonal = np.linalg.norm(first[:, None] - first, axis=2).max()
    assert diagonal == pytest.approx(np.hypot(1.0, 24 * np.sin(1 / 12)), rel=1e-9)
