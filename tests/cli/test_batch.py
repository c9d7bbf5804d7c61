"""``circparam batch``: options, refusals, codes, what is printed."""

import contextlib
import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from circparam.batch.manifest import encode_line
from circparam.batch.progress import Meter, Progress, printable
from circparam.cli.batch_progress import Screen, clock, headline
from tests.cli.test_group import command_of
from tests.support.batch_faults import QUICK, told, write_set
from tests.support.command_line import Terminal, one_line_error, run

ARGS = [part for k, v in QUICK.items() for part in (f"--{k}", str(v))]


def batch(*args: object) -> Result:
    return run("batch", *args)


def test_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    source = write_set(tmp_path / "src", 1)
    one_line_error(
        batch(source, "--out", tmp_path / "o", *ARGS), 2, "pip install 'circparam[batch]'"
    )
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    one_line_error(batch("s3://b/k", "--out", tmp_path / "o"), 2, "pip install 'circparam[batch]'")


def test_the_folder_and_the_workers_are_named_as_for_unwrap() -> None:
    """tests/batch/test_run.py runs a batch by the short names."""
    named = [set(param.opts) for param in command_of("batch").params]
    for names in ({"-o", "--out-dir", "--out"}, {"-j", "--jobs", "--workers"}):
        assert any(names <= opts for opts in named)


def test_a_run_its_status_and_gates(shared: str, tmp_path: Path) -> None:
    source, out = write_set(tmp_path / "src", 3), tmp_path / "out"
    (source / "bad\n.obj").write_text("nothing")
    first = batch(source, "--out", out, "--scheduler", shared, "--fail-if", "faces>20", *ARGS)
    assert first.exit_code == 6, first.output
    error = first.stderr.splitlines()
    assert r"bad\n.obj: " in first.stderr
    assert "2 of 4 files failed or missed a gate (50 %), more than --fail-rate 0" in error[-1]
    codes = {name: line["exit"] for name, line in told(out).items()}
    assert sorted(codes.values()) == [0, 0, 3, 6]
    assert codes["bad\n.obj"] == 3
    shown = batch("--status", out)
    assert shown.exit_code == 0
    assert "1 failed, 3 ok" in shown.stdout
    state = json.loads(batch("--status", out, "--json").stdout)
    assert (state["counts"], state["missed"], state["running"]) == (
        {"failed": 1, "ok": 3},
        1,
        False,
    )
    again = batch(source, "--out", out, "--fail-rate", 0.5, "--json", *ARGS)
    assert again.exit_code == 0, again.output
    summary = json.loads(again.stdout)
    assert (summary["done"], summary["skipped"], summary["codes"]) == (
        0,
        4,
        {"0": 2, "3": 1, "6": 1},
    )
    for name in ("report.html", "report.csv"):
        assert "bad\\n.obj" in (out / name).read_text()


def test_what_is_running_is_told(tmp_path: Path) -> None:
    (tmp_path / "manifest.jsonl").write_bytes(encode_line({"name": "a", "status": "ok", "exit": 0}))
    meter = Meter(total=10, skipped=2, weight=1000)
    line: dict[str, Any] = {"status": "ok", "exit": 0, "source_bytes": 100}
    meter.count(line)
    progress = meter.progress({"slow.obj": 61.0, "new.obj": 1.0}, 2, "")
    from circparam.batch.batch import _StatusFile
    from circparam.batch.store import Folder

    heard: list[Progress] = []
    _StatusFile(Folder(str(tmp_path)), heard.append)(progress)
    assert heard == [progress]
    state = json.loads(batch("--status", tmp_path, "--json").stdout)
    assert state["running"]
    assert state["run"]["running"][0] == ["slow.obj", 61.0]
    assert state["run"]["pid"] == os.getpid()
    text = batch("--status", tmp_path).stdout
    assert "1 of 8" in text
    assert "slow.obj" in text
    assert "3 of 10 done (2 before), 0 failed, 2 running on 2 workers" in headline(progress)


def test_a_line_a_minute_without_a_terminal(clock, capsys):
    screen = Screen(False, 0, False)
    progress = Progress(10, 0, {"ok": 1, "repaired": 0, "degraded": 0, "failed": 0})
    for second in range(0, 200, 10):
        clock.now = float(second)
        screen.show(progress)
    assert capsys.readouterr().err.count("1 of 10 done") == 3
    screen.line({"name": "a.obj", "error": "broken"})
    assert capsys.readouterr().err == "circparam: error: a.obj: broken\n"


def test_on_a_terminal_names_and_ages_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    out = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    with contextlib.redirect_stderr(out):
        screen = Screen(False, 0, False)
        running = tuple((f"m{k}\x1b.obj", 100.0 - k) for k in range(12))
        counts = {"ok": 4, "repaired": 0, "degraded": 0, "failed": 1}
        screen.show(Progress(30, 0, counts, 0, running, 1.5, 3700.0, 12, ""))
        screen.close()
    text = out.getvalue()
    assert "5 of 30 done, 1 failed, 12 running on 12 workers, 1.5 files/s, 1:01:40 left" in text
    assert "1:40" in text
    assert "m0\\x1b.obj" in text
    assert "and 4 more" in text


def test_what_is_printed_of_names_times_and_failures(capsys: pytest.CaptureFixture[str]) -> None:
    """Lines about failures stop at a number; with --quiet there are none."""
    assert [clock(s) for s in (5.9, 125, 7265, 400_000)] == ["5 s", "2:05", "2:01:05", "4.6 d"]
    assert printable("a\nb\udcff") == "a\\nb\\udcff"
    for quiet, lines in ((False, 51), (True, 0)):
        screen = Screen(True, 0, quiet)
        for k in range(200):
            screen.line({"name": f"{k}.obj", "error": "x"})
        assert capsys.readouterr().err.count("\n") == lines
