"""``circparam compare``: tables of 80 columns, JSON, CSV, exit codes."""

import csv
import errno
import json
import os
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from circparam import samples
from circparam.cli import cli
from circparam.compare import kim2019


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["compare", *words])


def sample(name: str) -> str:
    return str(samples.path(name))


def test_table_fits_and_names_every_method() -> None:
    result = run(sample("ribbon"), "--methods", "circle,lscm")
    assert result.exit_code == 0, result.stderr
    lines = result.stdout.splitlines()
    assert all(len(line) <= 80 or line == sample("ribbon") for line in lines)
    for name in ("circle", "lscm"):
        assert len([line for line in lines if line.startswith(name + " ")]) == 2  # cost and quality


def test_json_and_csv_hold_the_same_rows(tmp_path: Path) -> None:
    out = tmp_path / "rows.csv"
    result = run(sample("ribbon"), "--methods", "circle,floater", "--json", "--csv", str(out))
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    assert document["schema"] == "circparam/compare/1"
    assert document["table1"] is None
    (mesh,) = document["meshes"]
    with out.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert (
        [r["method"] for r in rows] == [r["method"] for r in mesh["rows"]] == ["circle", "floater"]
    )
    for written, printed in zip(rows, mesh["rows"], strict=True):
        assert float(written["distortion"]) == printed["distortion"]
        assert float(written["seconds_weights"]) == printed["stages"]["weights"]


def test_csv_is_not_overwritten(tmp_path: Path) -> None:
    out = tmp_path / "rows.csv"
    out.write_text("mine")
    result = run(sample("ribbon"), "--csv", str(out))
    assert result.exit_code == 2
    assert out.read_text() == "mine"
    assert run(sample("ribbon"), "--csv", str(tmp_path / "no" / "x.csv")).exit_code == 8


def test_a_crash_leaves_no_half_a_csv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows that were there stay until all new ones are on the disk."""
    out = tmp_path / "rows.csv"
    out.write_text("the rows of last week")

    def full(number: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    words = ("--methods", "circle", "--csv", str(out), "--overwrite", "-q")
    result = run(sample("ribbon"), *words)
    assert result.exit_code == 8, result.stderr
    assert "rows.csv" in result.stderr
    assert out.read_text() == "the rows of last week"
    assert [p.name for p in tmp_path.iterdir()] == ["rows.csv"]
    monkeypatch.undo()
    done = run(sample("ribbon"), *words)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
    assert out.read_text().startswith("mesh,cut,")


def test_the_older_name_of_a_flag_keeps_working() -> None:
    old, new = (
        json.loads(run(sample("ribbon"), "--methods", "circle", "--json", *more).stdout)
        for more in (("--border=square",), ("--boundary", "square"))
    )
    assert old["meshes"][0]["rows"][0]["distortion"] == new["meshes"][0]["rows"][0]["distortion"]
    assert "--border" not in run("--help").stdout


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (("--methods", "circel"), 2, "did you mean circle"),
        (("--methods", ""), 2, "names no method"),
        (("--methods", "circle,circle"), 2, "twice"),
        (("--cut", "disks"), 2, "did you mean disk"),
        (("--boundary", "squar"), 2, "square"),
        (("--repeats", "3"), 2, "--repeats has no effect here: it is for Table 1"),
        (("--timeout", "0"), 2, "--timeout 0.0: give a time in seconds, more than 0"),
    ],
)
def test_refusals(words: tuple[str, ...], code: int, text: str) -> None:
    result = run(sample("ribbon"), *words)
    assert result.exit_code == code
    assert text in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ""


def test_missing_file_is_exit_3_and_the_others_are_compared(tmp_path: Path) -> None:
    assert run(str(tmp_path / "none.obj")).exit_code == 3
    result = run(str(tmp_path / "none.obj"), sample("ribbon"), "--methods", "circle")
    assert result.exit_code == 3
    assert "none.obj" in result.stderr
    assert "ribbon" in result.stdout


def test_cut_that_does_not_suit_is_exit_4() -> None:
    for words in ((sample("knot"),), (sample("knot"), sample("ribbon"))):
        result = run(*words, "--cut", "none", "--methods", "circle")
        assert result.exit_code == 4
        assert f"error: {sample('knot')}: component 0" in result.stderr


def test_without_a_mesh_from_another_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bundled samples, here two of them, and Table 1 beside the paper's ratios."""
    names = ["ribbon", "knot"]
    monkeypatch.setattr(samples, "names", lambda pairs=True: names)
    monkeypatch.chdir(tmp_path)
    done = run("--methods", "circle,floater", "--cut", "disk", "--repeats", "1", "--json")
    assert done.exit_code == 0, done.stderr
    document = json.loads(done.stdout)
    assert [Path(m["mesh"]).stem for m in document["meshes"]] == names
    for mesh in document["meshes"]:
        for entry in mesh["rows"]:
            if entry["method"] != "input":
                assert (entry["status"], entry["flips"]) == ("ok", 0), (mesh["mesh"], entry)
    sizes = document["table1"]["sizes"]
    assert [s["vertices"] for s in sizes] == list(kim2019.PAPER)
    for s in sizes:
        assert s["ratio"] == pytest.approx(s["floater"]["median"] / s["circle"]["median"], rel=1e-9)
        own, floater = kim2019.PAPER[s["vertices"]]
        assert s["paper_ratio"] == pytest.approx(floater / own)
        for name in ("circle", "floater"):
            assert 0 < s[name + "_weights"]["median"] < s[name]["median"]


def test_table1_text_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(samples, "names", lambda pairs=True: [])
    result = run("--methods", "circle,floater", "--repeats", "1")
    assert result.exit_code == 0, result.stderr
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert "1.147 to 1.279" in result.stdout
    assert [line.split()[0] for line in lines if line.split()[0].isdigit()] == list(
        map(str, kim2019.PAPER)
    )
