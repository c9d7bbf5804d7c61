"""The report: its size, its figures, names that could do harm, pictures of results."""

import csv
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam.batch.index import Index
from circparam.batch.report import HISTOGRAM_BINS, report_page, save_report, thumbnails
from circparam.batch.store import Folder
from circparam.errors import OutputError
from tests.support.batch_faults import QUICK, write_disk
from tests.support.full_disk import fill_up


def line(name: str, **more: Any) -> dict[str, Any]:
    measures = {"charts": 3, "seam_length": 4.5, "distortion": 1.02, "pack": 0.5, "faces": 100}
    measures |= more.pop("measures", {})
    known = {"name": name, "source": f"/s/{name}", "status": "ok", "exit": 0, "seconds": 1.5}
    return {**known, "peak_memory": 2e8, "attempts": 1, "measures": measures, **more}


@pytest.fixture
def index() -> Iterator[Index]:
    with Index() as made:
        yield made


def data_of(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    return json.loads(found[1])


def test_ten_thousand_files_fit_and_more_are_in_the_table_alone(index, tmp_path):
    rng = np.random.default_rng(1)
    names = [f"some/longer/folder/name/{k:05d}/the_mesh_{k}.obj" for k in range(12_000)]
    index.add_lines(
        line(n, seconds=float(s), measures={"seam_length": float(s), "distortion": float(1 + s)})
        for n, s in zip(names, rng.gamma(2, 3, len(names)), strict=True)
    )
    index.add_lines(
        [line("broken.obj", status="failed", exit=3, error="broken", measures={}, seconds=0.1)]
    )
    address = save_report(Folder(str(tmp_path)), index)
    page = Path(address).read_text("utf-8")
    assert len(page.encode()) < 5_000_000
    data = data_of(page)
    assert len(data["rows"]) == 10_000
    assert data["rows"][0][0] == "broken.obj"  # what needs a look comes first
    seconds = [h["name"] for h in data["heads"]].index("seconds")
    times = [row[seconds] for row in data["rows"][1:]]
    assert times == sorted(times, reverse=True)
    rows = list(csv.DictReader((tmp_path / "report.csv").open(encoding="utf-8")))
    assert len(rows) == 12_001
    assert {r["name"] for r in rows} == {*names, "broken.obj"}


def test_what_a_page_says(index: Index) -> None:
    index.add_lines([line("a.obj"), line("b.obj", status="degraded", reasons=["it overlaps"])])
    index.add_lines(
        [
            line(f"x{k}.obj", status="failed", exit=3, error=f"/s/x{k}.obj: no faces")
            for k in range(7)
        ]
    )
    page = report_page(Folder("/nowhere"), index)
    tiles = re.findall(r'<strong>(\d+)</strong><span><i class="dot kind-(\w+)"', page)
    assert tiles == [("1", "ok"), ("0", "repaired"), ("1", "degraded"), ("7", "failed")]
    assert "<tr><td>7</td><td>3</td><td>no faces</td><td>x0.obj</td></tr>" in page  # one cause
    assert "prefers-color-scheme: dark" in page
    assert "http" not in page.replace("http-equiv", "")  # nothing from anywhere else


@pytest.mark.parametrize("name", ["</script><img src=x>.obj", "a\nb\x07\udcff.obj", "'\"&amp;.obj"])
def test_names_do_no_harm(name: str, index: Index) -> None:
    index.add_lines([line(name, status="degraded", reasons=[f"{name} is bad"], output_bytes=1)])
    page = report_page(Folder("/nowhere"), index)
    assert page.count("</script>") == 2
    assert "<img src=x>" not in page
    assert "\x07" not in page
    assert page.encode()  # all of it is text
    shown = data_of(page)["rows"][0][0]
    assert shown == name.replace("\n", "\\n").replace("\x07", "\\x07").replace("\udcff", "\\xff")


def test_the_bars_hold_all_values(index: Index) -> None:
    values = [1.0, 1.0, 5.0, 1000.0]
    index.add_lines([line(f"{k}.obj", seconds=v) for k, v in enumerate(values)])
    page = report_page(Folder("/nowhere"), index)
    figure = re.search(r"<h3>seconds</h3>(.*?)</figure>", page, re.S)
    bars = re.findall(r"<title>(\S+) to (\S+): (\d+)</title>", figure[1])
    assert sum(int(n) for *_, n in bars) == len(values)
    assert (bars[0][0], bars[0][2], bars[-1][1]) == ("1", "2", "1,000")
    assert "largest 1,000<" in figure[1]
    assert "(log)" in figure[1]
    index.add_lines([line("a.obj", measures={"pack": 0.01}), line("b.obj", measures={"pack": 0.9})])
    covered = report_page(Folder("/nowhere"), index).partition("<h3>covered %</h3>")[2]
    assert "(log)" not in covered.partition("</figure>")[0]
    assert len(bars) <= HISTOGRAM_BINS


def test_results_have_pictures(tmp_path: Path) -> None:
    mesh = write_disk(tmp_path / "m.obj")
    circparam.unwrap(str(mesh), str(tmp_path / "out.obj"), **QUICK)
    found = thumbnails(Folder(str(tmp_path)), "out.obj")
    assert len(found) == 2
    assert all(url.startswith("data:image/png;base64,") for url in found)
    assert thumbnails(Folder(str(tmp_path)), "nothing.obj") == []
    assert thumbnails(Folder(str(tmp_path)), "m.obj") == []  # it has no uv


def test_a_report_that_cannot_be_written_is_one_error_and_leaves_nothing(
    index: Index, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index.add_lines([line("a.obj")])
    fill_up(monkeypatch, "replace")
    with pytest.raises(OutputError, match=r"^[^:]*report\.csv: cannot be written") as caught:
        save_report(Folder(str(tmp_path)), index)
    assert str(caught.value).count("cannot be written") == 1
    assert list(tmp_path.iterdir()) == []
