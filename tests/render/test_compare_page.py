"""A comparison as a page and as an image."""

import itertools
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from circparam.compare.rows import Entry
from circparam.render.compare_page import bars, compare_page, scale_of
from circparam.render.side_by_side import caption, cell_text, draw_layouts, scenes_of
from circparam.render.text import drawable, has_glyph
from tests.support.side_by_side import compared, compared_sheet


class Tags(HTMLParser):
    """Checks that every element is closed, and keeps those that were opened."""

    VOID = frozenset({"meta", "link", "img", "input", "br", "rect"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict]] = []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag


def test_page_is_well_formed_and_complete():
    times = {"circle": SimpleNamespace(median=0.004), "floater": SimpleNamespace(median=0.005)}
    sizes = [
        SimpleNamespace(vertices=60, ratio=1.25, weights_ratio=1.1, paper_ratio=ratio, **times)
        for ratio in (1.3, None)
    ]
    text = compare_page([compared_sheet()], sizes)
    tags = Tags()
    tags.feed(text)
    assert tags.open == []
    images = [a for t, a in tags.seen if t == "img"]
    assert len(images) == 6  # three of each row that has a layout
    assert all(a["src"].startswith("data:image/png;base64,") for a in images)
    assert "<b>" not in text.replace("&lt;b&gt;", "")
    assert "out of luck &amp; time" in text
    assert text.count("<svg") == 2
    assert "1.250" in text
    shown = [a["data-show"] for t, a in tags.seen if "data-show" in a]
    layouts = [a["data-layout"] for t, a in tags.seen if "data-layout" in a]
    assert shown == layouts == ["0", "1"]  # a method without a layout has no place in the viewer
    assert not re.search(r"https?://(?!www\.w3\.org)", text)  # nothing is fetched from anywhere


def test_table_marks_the_best_valid_row_only():
    text = compare_page([compared_sheet()])
    best = re.findall(r'<td data-value="([^"]*)" class=best>', text)
    assert best == []  # one valid row is no competition
    sides = compared_sheet()
    rows = [sides.rows[0], Entry("second", "ok", seconds=1.0, figures={"distortion": 1.5})]
    text = compare_page([compared("sheet", sides.shape, rows)])
    assert re.findall(r'<td data-value="([^"]*)" class=best>', text) == ["1.0", "1.0"]


def test_bars_tell_values_apart_over_decades():
    """From 0.02 s to 3000 s: every bar is seen, each decade is as long, and equal steps are equal ratios."""
    values = [0.02, 0.3, 40.0, 3000.0]
    scale = scale_of(values)
    assert scale.logarithmic
    assert 0 < scale(0.02) < scale(0.3) < scale(40) < scale(3000) <= 1
    assert scale(40) - scale(4) == pytest.approx(scale(4) - scale(0.4))
    assert [value for value, _ in scale.ticks] == pytest.approx(
        [0.01, 0.1, 1, 10, 100, 1000, 10000]
    )
    decades = scale_of([1.0, 20.0])
    assert decades.logarithmic
    assert (decades(1.0), decades(100.0)) == (0.0, 1.0), "whole decades"
    close = scale_of([2.0, 3.0])
    assert not close.logarithmic
    assert (close(3.0), close(1.5)) == (1.0, 0.5)
    for nothing in ([], [0.0], [float("nan")], [1e300]):
        assert scale_of(nothing)(0.0) == 0.0
    assert len(scale_of([1e-6, 1e11]).ticks) <= 7


@pytest.mark.parametrize("key", ["seconds", "distortion"])
def test_nothing_of_a_bar_chart_is_cut_off(key: str):
    """Texts end inside the drawing, by a width that no letter of the page's fonts reaches in the mean."""
    rows = [
        Entry("m" * 24, "ok", {"a long stage": 0.5, "another one": 0.5}, figures={key: 1.0}),
        Entry("short", "ok", {"assembly of it all": 1.0}, figures={key: 1.23456789e9}),
        Entry("none", "failed"),
    ]
    root = ET.fromstring(bars(rows, key, "Title").replace("&nbsp;", " "))
    assert root.get("aria-label") == ("Title, logarithmic" if key == "seconds" else "Title")
    wide = float(root.get("viewBox").split()[2])
    for text in root.iter("text"):
        x, size = float(text.get("x")), 8.0 * len(text.text)
        start = x - size * {"end": 1.0, "middle": 0.5}.get(text.get("text-anchor"), 0.0)
        if text.get("class") != "title":
            assert start >= -1, text.text
            assert start + size <= wide + 1, text.text
    legend = [text for text in root.iter("text") if text.get("class") == "muted"]
    for name, after in itertools.pairwise(legend):
        if name.get("y") == after.get("y"):
            assert float(name.get("x")) + 6.0 * len(name.text) <= float(after.get("x"))


def test_captions_have_no_missing_glyphs():
    """What Pillow's font lacks is written in what it has."""
    row = Entry("x", "ok", seconds=0.5, figures={"charts": 1, "distortion": float("inf")})
    said = drawable(caption(row) + " é × ∞ – − Łódź 中 \u00a0")
    assert all(has_glyph(c) or c == " " for c in said)
    assert said.startswith("1 chart · distortion inf · 0.5 s")
    assert drawable("é×\u00a0–") == "ex -"
    assert not has_glyph("\u00a0")


def test_same_view_and_same_scale():
    sheet = compared_sheet()
    good, bad, none = draw_layouts(scenes_of(sheet.shape, sheet.rows), size=60, samples=1)
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
