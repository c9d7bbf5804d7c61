"""A comparison as a page and as an image."""

from __future__ import annotations

import re
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import pytest
from click.testing import CliRunner
from PIL import Image

from circparam import samples
from circparam.cli import cli
from circparam.errors import OptionError, OutputError
from circparam.render.compare_page import (
    _bar_end,
    _bar_parts,
    compare_page,
    compare_plot,
    save_plot,
    save_report,
)
from circparam.render.side_by_side import (
    MethodLayout,
    SideBySide,
)
from tests.support.full_disk import STEPS, fill_up
from tests.support.side_by_side import compared_sheet


@dataclass
class Spread:
    median: float


@dataclass
class Size:
    vertices: int
    circle: Spread
    floater: Spread
    ratio: float
    weights_ratio: float
    paper_ratio: float | None


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
    sizes = [
        Size(60, Spread(0.004), Spread(0.005), 1.25, 1.1, 1.25),
        Size(70, Spread(1), Spread(2), 2, 3, None),
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
    assert not re.search(r"https?://(?!www\.w3\.org)", text)  # nothing is fetched from anywhere


def test_table_marks_the_best_valid_row_only():
    text = compare_page([compared_sheet()])
    best = re.findall(r'<td data-value="([^"]*)" class=best>', text)
    assert best == []  # one valid row is no competition
    sides = compared_sheet()
    rows = [sides.rows[0], MethodLayout("second", None, "ok", {"seconds": 1.0, "distortion": 1.5})]
    text = compare_page([SideBySide("sheet", sides.mesh, rows)])
    assert re.findall(r'<td data-value="([^"]*)" class=best>', text) == ["1.0", "1.0"]


def test_plot_and_files(tmp_path: Path):
    sides = compared_sheet()
    image = compare_plot([sides, sides], columns=2)
    assert image.width >= 660
    save_plot(tmp_path / "a.png", [sides])
    save_report(tmp_path / "a.html", [sides])
    assert Image.open(tmp_path / "a.png").size[1] > 400
    again = compare_page([sides])
    assert (tmp_path / "a.html").read_text("utf-8") == again
    with pytest.raises(OptionError, match="html"):
        save_report(tmp_path / "a.txt", [sides])
    with pytest.raises(OptionError, match="png"):
        save_plot(tmp_path / "a.jpg", [sides])


def test_bars_add_up():
    rows = compared_sheet().rows
    parts = _bar_parts(rows[0], ["solve", "weights"])
    assert sum(share for share, _ in parts) == pytest.approx(1.0)
    assert [round(share, 3) for share, _ in parts] == [0.5, 0.25, 0.25]
    assert _bar_end([1.0, 1.0, 1000.0]) == 20.0
    assert _bar_end([]) == 1.0
    assert _bar_end([0.0]) == 1.0


def test_from_the_shell(tmp_path: Path):
    """compare --report --plot: both files, and a refusal before any work."""
    disk = str(samples.path("bumped-disk"))
    words = ["compare", disk, "--methods", "circle,mean-value", "-q"]
    report, plot = tmp_path / "r.html", tmp_path / "p.png"
    result = CliRunner().invoke(cli, [*words, "--report", str(report), "--plot", str(plot)])
    assert result.exit_code == 0, result.output
    text = report.read_text("utf-8")
    assert text.count("<article>") == 2
    assert text.count("<img ") == 6
    assert Image.open(plot).size[0] >= 660
    for option, name in (("--report", "r.txt"), ("--plot", "p.jpg"), ("--report", "r.html")):
        again = CliRunner().invoke(cli, [*words, option, str(tmp_path / name)])
        assert again.exit_code == 2


@pytest.mark.parametrize("step", STEPS)
def test_a_full_disk_leaves_nothing(
    step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill_up(monkeypatch, step)
    with pytest.raises(OutputError, match=r"a\.html.*No space left"):
        save_report(tmp_path / "a.html", [compared_sheet()])
    with pytest.raises(OutputError, match=r"a\.png.*No space left"):
        save_plot(tmp_path / "a.png", [compared_sheet()])
    assert list(tmp_path.iterdir()) == []
