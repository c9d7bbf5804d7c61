"""``circparam compare``: tables of 80 columns, JSON, CSV, exit codes."""

import csv
from pathlib import Path

import pytest

from circparam import samples
from circparam.compare import kim2019
from tests.support.command_line import done, one_line_error, report, run
from tests.support.full_disk import fill_up

RIBBON = samples.path("ribbon")


def test_table_fits_and_names_every_method() -> None:
    result = done("compare", RIBBON, "--methods", "circle,lscm")
    lines = result.stdout.splitlines()
    assert all(len(line) <= 80 or line == str(RIBBON) for line in lines)
    for name in ("circle", "lscm"):
        assert len([line for line in lines if line.startswith(name + " ")]) == 2  # cost and quality


def test_json_and_csv_hold_the_same_rows(tmp_path: Path) -> None:
    out = tmp_path / "rows.csv"
    document = report("compare", RIBBON, "--methods", "floater", "--csv", out)
    assert document["schema"] == "circparam/compare/1"
    assert document["table1"] is None
    (mesh,) = document["meshes"]
    with out.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    for written, printed in zip(rows, mesh["rows"], strict=True):
        assert written["method"] == printed["method"]
        assert float(written["distortion"]) == printed["distortion"]
        assert float(written["seconds_weights"]) == printed["stages"]["weights"]


def test_a_crash_leaves_no_half_a_csv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows that were there stay until all new ones are on the disk."""
    out = tmp_path / "rows.csv"
    out.write_text("the rows of last week")
    words = ("compare", RIBBON, "--methods", "circle", "--csv", out, "--overwrite", "-q")
    fill_up(monkeypatch, "fsync")
    result = run(*words)
    assert result.exit_code == 8, result.stderr
    assert "rows.csv" in result.stderr
    assert out.read_text() == "the rows of last week"
    assert [p.name for p in tmp_path.iterdir()] == ["rows.csv"]
    monkeypatch.undo()
    done = run(*words)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
    assert out.read_text().startswith("mesh,cut,")


def test_the_older_name_of_a_flag_keeps_working() -> None:
    """It means the same: a method without a boundary refuses it."""
    refused = run("compare", RIBBON, "--methods", "lscm", "--border=square")
    one_line_error(refused, 2, "--boundary has no effect")
    assert "--border" not in run("compare", "--help").stdout


def test_an_error_of_one_mesh_does_not_hide_the_others(tmp_path: Path) -> None:
    knot, none = samples.path("knot"), tmp_path / "none.obj"
    result = run("compare", none, knot, RIBBON, "--cut", "none", "--methods", "circle")
    assert result.exit_code == 3
    for said in (str(none), f"error: {knot}: component 0"):
        assert said in result.stderr
    assert "ribbon" in result.stdout


def test_without_a_mesh_from_another_directory(tmp_path, monkeypatch):
    """The bundled samples, here two of them, and Table 1 beside the paper's ratios."""
    names = ["ribbon", "knot"]
    monkeypatch.setattr(samples, "names", lambda pairs=True: names)
    monkeypatch.chdir(tmp_path)
    words = ("compare", "--methods", "circle,floater", "--repeats", "1")
    document = report(*words, "--cut", "disk")
    assert [Path(m["mesh"]).stem for m in document["meshes"]] == names
    for mesh in document["meshes"]:
        for entry in mesh["rows"]:
            if entry["method"] != "input":
                assert (entry["status"], entry["flips"]) == ("ok", 0), (mesh["mesh"], entry)
    sizes = document["table1"]["sizes"]
    assert [s["vertices"] for s in sizes] == list(kim2019.PRINTED_TIMES)
    for s in sizes:
        assert s["ratio"] == pytest.approx(s["floater"]["median"] / s["circle"]["median"], rel=1e-9)
    names.clear()
    lines = run(*words).stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert "1.147 to 1.279" in " ".join(lines)
    heads = [line.split()[0] for line in lines]
    assert [head for head in heads if head.isdigit()] == list(map(str, kim2019.PRINTED_TIMES))
