"""Unions of many candidates side by side, and the first look at all of them."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation import merge
from circparam.seams.segmentation.glues import Glues, side_by_side
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.state import Arcs, arcs_of
from circparam.seams.segmentation.unions import MergeOptions, first_look, lay_out
from circparam.solvers.newton import RelaxOptions
from circparam.solvers.objective import chart_energies
from circparam.solvers.pattern import elimination_ranks
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, middles, surface_of

STEPS = RelaxOptions(tolerance=1e-6, max_iterations=60)


def sheet_and_ball() -> Atlas:
    """A flat sheet in four pieces, which cost nothing to be merged, and a ball in eight, which do."""
    sheet, ball = shapes.grid(12, 12), shapes.icosphere(3)
    surface = surface_of(*shapes.join(sheet, (ball[0] + [5, 0, 0], ball[1])))
    middle = middles(surface)
    flat = np.abs(middle[:, 2]) < 1e-12
    flat[len(sheet[1]) :] = False
    octant = (middle > [5, 0, 0]) @ [1, 2, 4]
    quarter = (middle[:, :2] > 0.45) @ [1, 2]
    atlas = cut_between(surface, np.where(flat, quarter, 10 + octant))
    lay_out_fresh(atlas, None, STEPS)
    assert atlas.charts()[0] == 12
    return atlas


def energy_of(atlas: Atlas) -> float:
    """Energy times area of all charts."""
    cut_mesh, uv = atlas.open()
    return float(chart_energies(cut_mesh, uv) @ cut_mesh.chart_areas)


def candidates(atlas: Atlas) -> tuple[Arcs, Glues]:
    n, chart = atlas.charts()
    arcs = arcs_of(atlas, chart)
    merger = Merger(atlas, MergeOptions(1.05), np.zeros(len(atlas.cut), bool))
    return arcs, merger._glues(arcs, chart, n)


@pytest.mark.parametrize("kind", ["arcs", "pairs"])
def test_unions_side_by_side_are_those_of_one_candidate_each(kind: str) -> None:
    """Faces, inner edges and vertices of every union; many share a chart."""
    surface = surface_of(*shapes.icosphere(3))
    # three charts with two arcs between each two of them, and more
    x, y, z = middles(surface).T
    atlas = cut_between(surface, (np.abs(x) > 0.5) + 2 * (y > 0) + 4 * (z > 0.2))
    lay_out_fresh(atlas, None, RelaxOptions(tolerance=1e-2, max_iterations=5))
    arcs, glues = candidates(atlas)
    _, chart = atlas.charts()
    number = len(arcs.left)
    every = np.arange(number) if kind == "arcs" else number + np.unique(glues.pair)
    every = every[glues.left[every] != glues.right[every]]
    assert len(every) > 5
    together = side_by_side(atlas, arcs, glues, every, elimination_ranks(surface))
    for k, candidate in enumerate(every):
        left, right = glues.left[candidate], glues.right[candidate]
        faces = (chart == left) | (chart == right)
        glued = glues.glued(arcs, np.array([candidate]), len(atlas.cut))
        cut = atlas.cut & ~glued
        one, fid = surface.part_cut_mesh(cut, faces, np.zeros(len(chart), np.int64))
        sub, _, of = together.cut_mesh.subset(np.arange(len(every)) == k)
        assert len(sub.faces) == len(one.faces)
        assert len(sub.edges) == len(one.edges)
        assert sub.n_vertices == one.n_vertices
        assert sub.euler()[0] == one.euler()[0]
        corners = np.sort(together.corners[of].reshape(len(of), -1), axis=0)
        np.testing.assert_array_equal(
            corners, np.sort(atlas.corners[fid].reshape(len(fid), -1), axis=0)
        )
        assert together.in_right[of].sum() == (chart == right).sum()


def test_a_first_look_refuses_what_a_trial_would() -> None:
    atlas = sheet_and_ball()
    arcs, glues = candidates(atlas)
    every = np.arange(len(arcs.left))
    unions = side_by_side(atlas, arcs, glues, every, elimination_ranks(atlas.surface))
    found = []
    for room in (1e-6, 3e-2, 1.0):
        good, dear, crossed = first_look(unions, room)
        tried = lay_out(unions, MergeOptions(1.2, room=room), False, Monitor())
        assert not (good & dear).any()
        assert not (crossed & (good | dear)).any()
        np.testing.assert_array_equal(dear, tried.dear)
        assert not ((tried.energy <= 1.2) & ~tried.overlapping & ~good).any()
        found.append(int(dear.sum()))
    assert found[0] > found[1] >= found[2] == 0
    assert found[0] == 12  # the arcs of the ball


def test_a_first_look_finds_as_many_unions_with_fewer_trials(monkeypatch) -> None:
    merged, trials = [], []
    laid = merge.lay_out
    for faces in (0, 10**6):
        monkeypatch.setattr(merge, "LOOKED_AT", faces)
        atlas, count = sheet_and_ball(), [0]

        def counted(unions, *rest, count=count):
            count[0] += unions.cut_mesh.n_charts
            return laid(unions, *rest)

        monkeypatch.setattr(merge, "lay_out", counted)
        most = (1 + 1e-6) * energy_of(atlas)
        merger = Merger(atlas, MergeOptions(1.2, rise=1e-6), np.zeros(len(atlas.cut), bool))
        merger.run(Monitor())
        assert energy_of(atlas) <= most
        merged.append(atlas.cut)
        trials.append(count[0])
    assert atlas.charts()[0] == 9
    np.testing.assert_array_equal(*merged)
    assert trials[1] < 6 < 12 < trials[0]


def test_what_there_was_no_room_for_is_tried_again_where_there_is_more_and_nothing_else() -> None:
    atlas = sheet_and_ball()
    merger = Merger(atlas, MergeOptions(1.2, rise=1e-6), np.zeros(len(atlas.cut), bool))
    merger.run(Monitor())
    assert merger.tally["merged"] == 3
    assert 0 < len(merger.dear) < len(merger.tried)
    left = np.setdiff1d(merger.tried, merger.dear)
    merger.more_room(0.05 * float(atlas.surface.areas.sum()))
    np.testing.assert_array_equal(merger.tried, left)
    assert merger.work == 0
    merger.run(Monitor())
    assert merger.tally["merged"] > 3


def test_a_flat_sheet_needs_no_room() -> None:
    sheet = surface_of(*shapes.grid(8, 8))
    atlas = as_it_lies(cut_between(sheet, (middles(sheet)[:, 0] > 0.4).astype(np.int64)))
    arcs, glues = candidates(atlas)
    unions = side_by_side(atlas, arcs, glues, np.zeros(1, np.int64), elimination_ranks(sheet))
    assert [x.tolist() for x in first_look(unions, 1e-9)] == [[True], [False], [False]]


def test_charts_of_one_face_have_no_edge_of_their_own() -> None:
    """A sheet and its last face: no inner edge bears the number of that face's chart."""
    sheet = surface_of(*shapes.grid(4, 4))
    label = np.zeros(len(sheet.faces), np.int64)
    label[-1] = 1
    atlas = as_it_lies(cut_between(sheet, label))
    arcs, glues = candidates(atlas)
    every = np.arange(len(arcs.left))
    unions = side_by_side(atlas, arcs, glues, every, elimination_ranks(sheet))
    assert np.bincount(unions.cut_mesh.chart).tolist() == [len(sheet.faces)] * len(every)
    assert unions.in_right.sum() == len(every)
    assert first_look(unions, 1e-9)[0].all()
