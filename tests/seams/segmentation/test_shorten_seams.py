"""Seams shortened chain by chain: which chains go back, and which charts are laid out at all."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation import shorten_seams as module
from circparam.seams.segmentation.shorten_seams import shorten_seams
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, middles, surface_of

FINE = RelaxOptions(tolerance=1e-8, max_iterations=60)


def sheets(jagged: tuple[bool, bool]) -> Atlas:
    """Two flat sheets, each in a lower and an upper half with a straight seam between them or a jagged one."""
    surface = surface_of(*shapes.row_of(shapes.grid(9, 9), 2))
    middle = middles(surface)
    m = len(surface.faces) // 2
    label = np.zeros(2 * m, np.int64)
    for k, teeth in enumerate(jagged):
        part = slice(k * m, (k + 1) * m)
        x, y = middle[part, 0] - middle[part, 0].min(), middle[part, 1] - middle[part, 1].min()
        y = y / y.max()
        below = y < 0.5
        if teeth:
            below |= (y < 0.58) & np.isin((x / x.max() * 7.99).astype(int), [2, 5])
        label[part] = 2 * k + below
    return as_it_lies(cut_between(surface, label))


def test_charts_beside_no_chain_that_moves_are_not_laid_out(monkeypatch) -> None:
    atlas = sheets((True, False))
    faces: list[int] = []
    laid_out = module.lay_out_again

    def counted(part: Atlas, *rest, **named):
        faces.append(len(part.surface.faces))
        return laid_out(part, *rest, **named)

    monkeypatch.setattr(module, "lay_out_again", counted)
    before = atlas.seam_length
    other = atlas.corners[len(atlas.corners) // 2 :].copy()
    laid = shorten_seams(atlas, 1.01, FINE)
    assert atlas.seam_length < before
    assert laid.energy == pytest.approx(np.ones(4), abs=1e-9)
    assert faces == [len(atlas.surface.faces) // 2]
    assert np.array_equal(atlas.corners[len(atlas.corners) // 2 :], other)


def test_a_chain_that_spoils_its_charts_goes_back_and_the_others_stay(monkeypatch) -> None:
    atlas = sheets((True, True))
    m = len(atlas.surface.faces) // 2
    was, corners = atlas.cut.copy(), atlas.corners.copy()
    laid_out = module.lay_out_again
    surface = atlas.surface
    far = surface.points[surface.faces[m:]][:, :, 0].min() - 1e-9

    def in_far_sheet(part: Atlas) -> np.ndarray:
        return part.surface.points[part.surface.faces[:, 0], 0] >= far

    def far_seams(part: Atlas) -> float:
        seam = part.cut & in_far_sheet(part)[part.surface.edges[:, 0] // 3]
        return float(part.surface.edge_lengths[seam].sum())

    whole = far_seams(atlas)

    def refused(part: Atlas, *rest, **named):
        """The second sheet is bad as soon as its seam moves."""
        now = laid_out(part, *rest, **named)
        if far_seams(part) < whole - 1e-9:
            now.energy[np.unique(now.cut_mesh.chart[in_far_sheet(part)])] = np.inf
        return now

    monkeypatch.setattr(module, "lay_out_again", refused)
    shorten_seams(atlas, 1.01, FINE)
    in_second = atlas.surface.edges[:, 0] // 3 >= m
    assert np.array_equal(atlas.cut[in_second], was[in_second])
    assert np.array_equal(atlas.corners[m:], corners[m:])
    assert not np.array_equal(atlas.cut[~in_second], was[~in_second])


def test_no_chain_is_tried_again_where_none_can_help_a_frail_chart(monkeypatch) -> None:
    """A chart with nothing to shorten is bad as soon as it is laid out: all stays, so nothing needs trying."""
    atlas = sheets((True, False))
    m = len(atlas.surface.faces) // 2
    was, corners = atlas.cut.copy(), atlas.corners.copy()
    laid_out = module.lay_out_again

    def all_bad(part: Atlas, *rest, **named):
        now = laid_out(part, *rest, **named)
        now.energy[:] = np.inf
        return now

    tried: list[int] = []
    matched = module.matching

    def counted(*given):
        tried.append(len(given[0]))
        return matched(*given)

    monkeypatch.setattr(module, "lay_out_again", all_bad)
    monkeypatch.setattr(module, "matching", counted)
    shorten_seams(atlas, 1.01, FINE)
    assert tried == []
    np.testing.assert_array_equal(atlas.cut, was)
    np.testing.assert_array_equal(atlas.corners, corners)

    def moved_bad(part: Atlas, *rest, **named):
        """As above, but what lies in the straight sheet is good: nothing forbids another try."""
        now = all_bad(part, *rest, **named)
        now.energy[now.cut_mesh.chart[part.surface.source >= m]] = 1.0
        return now

    monkeypatch.setattr(module, "lay_out_again", moved_bad)
    sheet = sheets((True, False))
    sheet.corners[:] = corners
    shorten_seams(sheet, 1.01, FINE)
    assert tried == [1], "the frail charts have a chain that may help them"


@pytest.mark.parametrize("helped", [False, True])
def test_a_chart_bad_as_it_is_gets_few_rounds_unless_a_chain_helps_it(monkeypatch, helped) -> None:
    """A sheet beside five others, each with a jagged seam to it: one chain a round can be tried."""
    points, faces = shapes.grid(41, 41)
    surface = surface_of(points * [1, 1, 0], faces)
    x, y = middles(surface)[:, :2].T
    row = np.minimum(np.floor(y * 5), 4)
    teeth = np.abs(np.floor(y * 40) - 8 * row - 3.5) < 2
    left = np.floor(x * 40) < np.where(teeth, 22, 20)
    atlas = as_it_lies(cut_between(surface, np.where(left, 0, 1 + row.astype(np.int64))))
    assert atlas.charts()[0] == 6
    was = atlas.cut.copy()
    laid_out, matched = module.lay_out_again, module.matching
    rounds: list[int] = []

    def counted(*given):
        rounds.append(len(given[0]))
        return matched(*given)

    def bad_left(part: Atlas, *rest, **named):
        now = laid_out(part, *rest, **named)
        if helped and rounds:  # what is tried alone is good
            return now
        now.energy[np.unique(now.cut_mesh.chart[middles(part.surface)[:, 0] < 0.4])] = np.inf
        return now

    monkeypatch.setattr(module, "lay_out_again", bad_left)
    monkeypatch.setattr(module, "matching", counted)
    shorten_seams(atlas, 1.01, FINE)
    assert len(rounds) == (5 if helped else 1 + module.BARREN)
    assert np.array_equal(atlas.cut, was) != helped
