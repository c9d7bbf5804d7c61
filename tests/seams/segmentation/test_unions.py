"""Unions of two charts laid out together: exact where they fit, relaxed where they do not."""

import dataclasses

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.overlap import self_overlapping
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.unions import MergeOptions, Unions, lay_out
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, surface_of, uncut

OPTIONS = MergeOptions(1.05)
RIGID = dataclasses.replace(OPTIONS, rigid=True)
FINE = RelaxOptions(tolerance=1e-10, max_iterations=200)


def rotated(corners: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return corners @ np.array([[c, s], [-s, c]])


def halves(*parts: tuple, angle: float = 0.8) -> Unions:
    """Every part cut in two at x = 0.5 of its own and laid out by itself, the right side turned and moved."""
    apart = [(p + np.array([0, 2.0 * k, 0]), f) for k, (p, f) in enumerate(parts)]
    surface = surface_of(*shapes.join(*apart))
    number = np.repeat(np.arange(len(parts)), [len(f) for _, f in parts])
    right = np.concatenate([p[f].mean(1)[:, 0] > 0.5 for p, f in parts])
    atlas = cut_between(surface, 2 * number + right)
    lay_out_fresh(atlas, None, FINE)
    moved = rotated(atlas.corners, angle) + np.array([3.0, -2.0])
    corners = np.where(right[:, None, None], moved, atlas.corners)
    whole = Atlas(surface, np.zeros(len(surface.edges), bool)).cut_mesh()
    assert whole.n_charts == len(parts)
    return Unions(whole, corners, right)


def hill(height: float) -> tuple[np.ndarray, np.ndarray]:
    points, faces = shapes.grid(9, 9)
    away = ((points[:, :2] - 0.5) ** 2).sum(1)
    return points + np.outer(height * np.exp(-away / 0.05), [0, 0, 1]), faces


@pytest.mark.parametrize("options", [OPTIONS, RIGID], ids=["bent", "rigid"])
@pytest.mark.parametrize("angle", [0.0, 0.8, 2.5, -1.5])
def test_halves_of_a_sheet_are_put_together_whatever_their_turn(options, angle: float) -> None:
    unions = halves(shapes.grid(9, 5), angle=angle)
    tried = lay_out(unions, options, False, Monitor())
    assert tried.energy == pytest.approx([1.0], abs=1e-6)
    assert not tried.distorted.any()
    assert not tried.overlapping.any()
    span = np.ptp(tried.uv, axis=0)
    assert np.hypot(*span) >= np.sqrt(2) - 1e-3


def test_the_energy_is_that_of_the_layout_and_of_a_relaxation_of_the_whole() -> None:
    unions = halves(hill(0.15))
    tried = lay_out(unions, dataclasses.replace(OPTIONS, tolerance=1e-8), False, Monitor())
    assert tried.energy == pytest.approx(chart_energies(unions.cut_mesh, tried.uv))
    whole = relax(unions.cut_mesh, tried.uv, FINE)
    assert whole.energy[0] > 1.001
    assert tried.energy == pytest.approx(whole.energy, rel=1e-4)
    assert tried.floor[0] <= whole.energy[0] + 1e-12


@pytest.mark.parametrize("options", [OPTIONS, RIGID], ids=["bent", "rigid"])
def test_a_union_is_distorted_where_its_best_is_above_the_bound(options) -> None:
    unions = halves(hill(0.3))
    start = uncut(*hill(0.3))
    best = float(lay_out_fresh(start, None, FINE).energy[0])
    for share, distorted in ((1.05, False), (0.95, True)):
        bound = 1 + (best - 1) * share
        tried = lay_out(unions, dataclasses.replace(options, bound=bound), False, Monitor())
        assert tried.distorted.tolist() == [distorted]
        assert not tried.overlapping.any()


def spiral(turn: float) -> Unions:
    """Both halves of a flat ring of an angle; beyond a full turn the union covers itself."""
    t, r = np.meshgrid(np.linspace(0, turn, 80), np.linspace(0.7, 1, 4), indexing="ij")
    t, r = t.ravel(), r.ravel()
    p = np.stack([r * np.cos(t), r * np.sin(t), 1e-4 * t], 1)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(79), np.arange(3), indexing="ij"))
    a, b, c, d = 4 * i + j, 4 * i + j + 1, 4 * i + j + 5, 4 * i + j + 4
    faces = np.r_[np.stack([a, b, c], 1), np.stack([a, c, d], 1)][:, ::-1]
    surface = surface_of(p, np.ascontiguousarray(faces))
    right = np.r_[i, i] > 40
    atlas = cut_between(surface, right.astype(np.int64))
    lay_out_fresh(atlas, None, FINE)
    whole = Atlas(surface, np.zeros(len(surface.edges), bool)).cut_mesh()
    return Unions(whole, atlas.corners, right)


@pytest.mark.parametrize("options", [OPTIONS, RIGID], ids=["bent", "rigid"])
@pytest.mark.parametrize("crowd", [False, True])
def test_unions_that_lie_on_themselves_overlap_and_are_not_distorted(options, crowd) -> None:
    for turn, overlapping in ((5.5, False), (8.0, True)):
        tried = lay_out(spiral(turn), options, crowd, Monitor())
        assert tried.overlapping.tolist() == [overlapping]
        assert not tried.distorted.any()


def test_parts_that_only_touch_are_pushed_apart_unless_there_is_a_crowd() -> None:
    unions = spiral(2 * np.pi - 0.001)
    found = [lay_out(unions, OPTIONS, crowd, Monitor()) for crowd in (False, True)]
    assert [t.overlapping.tolist() for t in found] == [[False], [True]]
    assert not self_overlapping(unions.cut_mesh, found[0].uv).any()
    assert chart_energies(unions.cut_mesh, found[0].uv)[0] <= OPTIONS.bound


def test_a_slit_is_sewn_without_turning_anything() -> None:
    """Both sides are one chart then: none of its faces is turned."""
    atlas = as_it_lies(uncut(*shapes.grid(6, 6)))
    cut_mesh = atlas.cut_mesh()
    none = np.zeros(len(cut_mesh.faces), bool)
    for options in (OPTIONS, RIGID):
        tried = lay_out(Unions(cut_mesh, atlas.corners, none), options, False, Monitor())
        away = tried.uv - tried.uv.mean(0) - (atlas.gather(cut_mesh) - 0.5)
        assert np.abs(away).max() < 1e-6
