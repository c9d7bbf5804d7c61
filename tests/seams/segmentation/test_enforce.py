"""Charts held to the bound: slit, split, pushed apart or laid out anew."""

import dataclasses

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh, not_disks
from circparam.seams.segmentation import grow
from circparam.seams.segmentation.enforce import enforce, unstick
from circparam.seams.segmentation.layout import ChartLayouts, judge, lay_out_fresh
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, middles, surface_of, uncut

GAPS = RelaxOptions(tolerance=1e-6, max_iterations=40)


def judged(atlas: Atlas) -> ChartLayouts:
    cut_mesh = atlas.cut_mesh()
    return judge(cut_mesh, atlas.gather(cut_mesh))


def flat_arc(turn: float) -> tuple[np.ndarray, np.ndarray]:
    """A flat ring of an angle, about a full turn, one end a little above the other."""
    t, r = np.meshgrid(np.linspace(0, turn, 60), np.linspace(0.7, 1, 4), indexing="ij")
    t, r = t.ravel(), r.ravel()
    p = np.stack([r * np.cos(t), r * np.sin(t), 1e-4 * t], 1)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(59), np.arange(3), indexing="ij"))
    a, b, c, d = 4 * i + j, 4 * i + j + 1, 4 * i + j + 5, 4 * i + j + 4
    return p, np.r_[np.stack([a, b, c], 1), np.stack([a, c, d], 1)][:, ::-1]


def upright(atlas: Atlas) -> Atlas:
    """As it lies, mirrored where it is seen from behind."""
    as_it_lies(atlas)
    d = atlas.corners[:, 1:] - atlas.corners[:, :1]
    area = (d[:, 0, 0] * d[:, 1, 1] - d[:, 0, 1] * d[:, 1, 0]).sum()
    atlas.corners = atlas.corners * [np.sign(area), 1]
    return atlas


def test_parts_that_lie_on_each_other_by_little_are_pushed_apart() -> None:
    """Only in charts that are chosen and below the bound; no seam is needed for it."""
    surface = surface_of(*flat_arc(2 * np.pi + 0.005))
    start = upright(Atlas(surface, np.zeros(len(surface.edges), bool)))
    laid = judged(start)
    assert laid.overlapping.all()
    assert laid.energy[0] < 1.001
    yes, no = np.ones(1, bool), np.zeros(1, bool)
    pushed = unstick(start, laid, 1.05, Monitor(), yes)
    assert not pushed.overlapping.any()
    assert pushed.energy[0] <= 1.05
    assert np.array_equal(start.corners, pushed.uv[pushed.cut_mesh.faces])
    for which, bound in ((no, 1.05), (yes, np.nextafter(laid.energy[0], 0))):
        atlas = upright(Atlas(surface, np.zeros(len(surface.edges), bool)))
        kept = unstick(atlas, laid, float(bound), Monitor(), which)
        assert kept is laid
    wound = surface_of(*flat_arc(3 * np.pi))
    deep = upright(Atlas(wound, np.zeros(len(wound.edges), bool)))
    before = deep.corners.copy()
    unstick(deep, judged(deep), 1.05, Monitor(), yes)
    assert np.array_equal(deep.corners, before), "what pushing does not separate stays as it was"
    atlas = upright(Atlas(surface, np.zeros(len(surface.edges), bool)))
    enforce(atlas, grow.dual_graph(surface), laid, 1.05, GAPS, Monitor())
    assert not atlas.cut.any()
    assert not judged(atlas).bad(1.05).any()


def test_charts_that_lie_on_themselves_are_cut_and_good_ones_are_not() -> None:
    """A ring of one turn and a half, which nothing pushes apart, beside a flat sheet."""
    ring = flat_arc(3 * np.pi)
    sheet = shapes.grid(12, 12)
    surface = surface_of(*shapes.join(ring, (sheet[0] + [3.0, 0, 0], sheet[1])))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    m = len(ring[1])
    as_it_lies(atlas)
    alone = upright(uncut(*ring))
    atlas.corners[:m] = alone.corners
    flat = atlas.corners[m:].copy()
    laid = judged(atlas)
    assert laid.overlapping.tolist() == [True, False]
    enforce(atlas, grow.dual_graph(surface), laid, 1.05, GAPS, Monitor())
    after = judged(atlas)
    assert not after.bad(1.05).any()
    on_ring = surface.edges[:, 0] // 3 < m
    assert atlas.cut[on_ring].any()
    assert not atlas.cut[~on_ring].any()
    assert np.array_equal(atlas.corners[m:], flat)
    # cut, not bent: the pieces keep the layout they had
    assert after.energy == pytest.approx(np.ones(after.cut_mesh.n_charts), abs=1e-3)
    assert 3 <= after.cut_mesh.n_charts <= 4


@pytest.mark.parametrize("bound", [1.3, 1.05, 1.01])
def test_a_closed_shape_ends_in_good_disks_whatever_the_bound(bound: float) -> None:
    surface = surface_of(*shapes.icosphere(2))
    atlas = cut_between(surface, (middles(surface)[:, 2] > 0).astype(np.int64))
    laid = lay_out_fresh(atlas, None, GAPS)
    count = atlas.charts()[0]
    enforce(atlas, grow.dual_graph(surface), laid, bound, GAPS, Monitor())
    after = judged(atlas)
    assert not after.bad(bound).any()
    assert not not_disks(after.cut_mesh).any()
    assert (after.cut_mesh.n_charts > count) == (laid.energy.max() > 1 + (bound - 1) * 1.6)


def test_good_charts_and_single_cells_are_left_as_they_are() -> None:
    atlas = as_it_lies(uncut(*shapes.grid(5, 5)))
    before = atlas.corners.copy()
    enforce(atlas, grow.dual_graph(atlas.surface), judged(atlas), 1.0 + 1e-9, GAPS, Monitor())
    assert not atlas.cut.any()
    assert np.array_equal(atlas.corners, before)
    # one polygon cannot be split
    ball = shapes.hemisphere(3)
    surface = surface_of(*ball)
    surface = dataclasses.replace(surface, locked=np.ones(len(surface.edges), bool))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    laid = lay_out_fresh(atlas, None, GAPS)
    enforce(atlas, grow.dual_graph(surface), laid, 1.001, GAPS, Monitor())
    assert not atlas.cut.any()
    # and when the time is up nothing is begun
    free = uncut(*ball)
    laid = lay_out_fresh(free, None, GAPS)
    enforce(free, grow.dual_graph(free.surface), laid, 1.001, GAPS, Monitor(timeout=0.0))
    assert not free.cut.any()


def layouts() -> tuple[CutMesh, np.ndarray]:
    """A flat sheet, a bumped disk and one face alone, with good layouts."""
    single = shapes.triangle()
    parts = shapes.grid(6, 6), shapes.bumped_disk(80), (single[0] * 2, single[1])
    atlas = uncut(*shapes.join(*parts))
    laid = lay_out_fresh(atlas, None, GAPS)
    assert np.isfinite(laid.energy).all()
    return laid.cut_mesh, laid.uv
