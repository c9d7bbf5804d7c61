"""Boundary first flattening: the automatic map, the disk, and lengths of the user."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.errors import OptionError
from circparam.geometry.distortion import measure
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.methods.bff import bff
from tests.support import shapes
from tests.support.charts import apart, complex_of, patches_of


def run(shape, border=None):
    patches, points = patches_of(shape)
    return patches, points, bff(patches, MethodOptions(bff_border=border), Monitor())


def border_lengths(patches, uv):
    h = patches.border
    i, j = patches.faces.ravel()[h], patches.faces[:, [1, 2, 0]].ravel()[h]
    return np.hypot(*(uv[j] - uv[i]).T)


@pytest.mark.parametrize("shape", [shapes.half_cylinder(), shapes.cone(slit=True), shapes.grid()])
def test_developable_charts_are_isometric(shape):
    patches, _, layout = run(shape)
    assert measure(patches, layout.uv).sd == pytest.approx(1, abs=1e-8)


def test_a_hemisphere_converges_to_the_stereographic_projection():
    errors = []
    for n in (6, 12, 24):
        _, points, layout = run(shapes.hemisphere(n))
        z = complex_of(points[:, :2]) / (1 + points[:, 2])
        errors.append(apart(layout.uv, np.stack([z.real, z.imag], 1)))
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > 1.0).all(), errors


def test_the_border_keeps_its_lengths():
    patches, _, layout = run(shapes.bumped_disk(1000))
    ratio = border_lengths(patches, layout.uv) / patches.edge_lengths.ravel()[patches.border]
    assert ratio.std() / ratio.mean() < 0.05
    lscm = METHODS["lscm"].function(patches, MethodOptions(), Monitor()).uv
    other = border_lengths(patches, lscm) / patches.edge_lengths.ravel()[patches.border]
    assert ratio.std() / ratio.mean() < other.std() / other.mean()


def test_angles_are_those_of_lscm():
    patches, _, layout = run(shapes.bumped_disk(2000, 0.4))
    lscm = METHODS["lscm"].function(patches, MethodOptions(), Monitor()).uv
    a, b = (measure(patches, uv).whole["angle"] for uv in (layout.uv, lscm))
    assert a == pytest.approx(b, rel=0.005)


def test_the_disk_is_round():
    patches, _, layout = run(shapes.bumped_disk(1000), "disk")
    border = np.unique(patches.faces.ravel()[patches.border])
    z = complex_of(layout.uv)
    # the circle through the border, by least squares
    a = np.c_[2 * z[border].real, 2 * z[border].imag, np.ones(len(border))]
    centre = np.linalg.lstsq(a, np.abs(z[border]) ** 2, rcond=None)[0]
    radius = np.abs(z[border] - complex(centre[0], centre[1]))
    assert np.ptp(radius) < 1e-9 * radius.mean()
    free = bff(patches, MethodOptions(), Monitor()).uv
    # a disk is another conformal map of the same surface: the angles hardly suffer
    angle = [measure(patches, uv).whole["angle"] for uv in (layout.uv, free)]
    assert angle[0] < 1 + 1.5 * (angle[1] - 1)


def test_lengths_of_the_user_are_met_up_to_closing():
    patches, _ = patches_of(shapes.half_cylinder())
    own = patches.edge_lengths.ravel()[patches.border]
    layout = bff(patches, MethodOptions(bff_border=2 * own), Monitor())
    np.testing.assert_allclose(border_lengths(patches, layout.uv), 2 * own, rtol=1e-6)


@pytest.mark.parametrize(
    ("border", "word"),
    [
        ("square", "unknown border of bff"),
        (np.ones(3), "outer border edges"),
        (-np.ones(28), "above 0"),
    ],
)
def test_bad_borders_are_refused(border, word):
    with pytest.raises(OptionError, match=word):
        run(shapes.grid(9, 7), border)


def test_a_flat_ring_comes_back_with_its_own_lengths_too():
    patches, points, layout = run(shapes.annulus())
    assert apart(layout.uv, points[:, :2]) < 1e-9
    loops = patches.loops
    outer = np.sort(loops.half_edges[loops.outer[loops.loop_of]])
    own = patches.edge_lengths.ravel()[outer]
    twice = bff(patches, MethodOptions(bff_border=2 * own), Monitor())
    assert apart(twice.uv, points[:, :2]) < 1e-9
    assert np.ptp(twice.uv[:, 0]) == pytest.approx(4, rel=1e-9)


def test_lengths_on_the_outer_border_are_met_round_holes_too():
    shape = shapes.planar_holes(3, seed=1)
    patches, _ = patches_of(shapes.waved(shape, 0.1))
    loops = patches.loops
    assert len(loops.chart) == 4
    h = np.sort(loops.half_edges[loops.outer[loops.loop_of]])
    own = patches.edge_lengths.ravel()[h]
    uv = bff(patches, MethodOptions(bff_border=1.5 * own), Monitor()).uv
    i, j = patches.faces.ravel()[h], patches.faces[:, [1, 2, 0]].ravel()[h]
    ratio = np.hypot(*(uv[j] - uv[i]).T) / own
    np.testing.assert_allclose(ratio, 1.5, rtol=0.02)


def test_the_disk_takes_holes():
    patches, _, layout = run(shapes.annulus(), "disk")
    outer = patches.loops.half_edges[patches.loops.outer[patches.loops.loop_of]]
    radius = np.abs(complex_of(layout.uv))[patches.faces.ravel()[outer]]
    assert np.ptp(radius) < 1e-9
    assert measure(patches, layout.uv).flips == 0
