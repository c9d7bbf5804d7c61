"""Layouts of one mesh drawn alike, and their figures in words."""

from dataclasses import replace

import numpy as np

from circparam.render.side_by_side import cell_text, draw_layouts, scenes_of
from tests.support.side_by_side import compared_sheet


def test_same_view_and_same_scale():
    sheet = compared_sheet()
    scenes = scenes_of(sheet.shape, sheet.rows)
    good, bad, none = draw_layouts(scenes, size=60, samples=1)
    assert none is None
    shape = [np.asarray(i.convert("L")) < 250 for i in (good[1], bad[1])]
    assert np.array_equal(*shape)  # the same silhouette
    assert np.asarray(good[2]).mean() > np.asarray(bad[2]).mean() + 5


def test_a_view_of_a_tall_mesh_is_no_higher_than_wide():
    tall = compared_sheet()
    mesh = replace(tall.shape, points=tall.shape.points * [1.0, 5.0, 1.0])
    shown = draw_layouts(scenes_of(mesh, tall.rows), size=60, samples=1)
    assert shown[0][1].size == (60, 60)


def test_cells():
    assert cell_text("seconds", None) == "–"
    assert cell_text("stretch_linf", float("inf")) == "∞"
    assert cell_text("pack", 0.614) == "61.4 %"
    assert cell_text("peak_bytes", 1_234_000_000) == "1,234"
    assert cell_text("charts", 12345) == "12,345"
    assert cell_text("stretch_linf", 7.7e146) == "over 1e9"
