"""A few fuzz cases on every run; ``make fuzz`` runs thousands."""

import signal
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings

from circparam import formats
from circparam.cli import cli
from circparam.mesh.mesh import UVMap
from tests.fuzz import hostile
from tests.fuzz.cases import Case, cases, layouts_of_others
from tests.fuzz.check import ALLOWED, bounded, judge, live_faces, overlapping, problems
from tests.support import shapes
from tests.support.writers import obj

needs_alarm = pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="the bound needs SIGALRM")


@needs_alarm
@settings(max_examples=12, database=None, suppress_health_check=list(HealthCheck))
@given(cases())
def test_whatever_comes_in_ends_as_documented(case: Case) -> None:
    with tempfile.TemporaryDirectory() as name:
        assert problems(case, Path(name), bound=30) == []


@needs_alarm
@settings(max_examples=60, database=None, suppress_health_check=list(HealthCheck))
@given(layouts_of_others())
def test_layouts_of_others_are_judged_as_integers_judge_them(case: Case) -> None:
    with tempfile.TemporaryDirectory() as name:
        assert problems(case, Path(name), bound=30) == []


def test_the_judge_finds_a_lying_report(tmp_path: Path) -> None:
    """The fuzzer's own check must be able to fail: a layout that was folded behind the report is found out."""
    source, target = tmp_path / "in.obj", tmp_path / "out.obj"
    source.write_bytes(obj(*shapes.bumped_disk(60)))
    words = ["unwrap", str(source), "-o", str(target), "--no-normalize", "--json"]
    said = CliRunner().invoke(cli, words).stdout
    case = Case("mesh.obj", source.read_bytes(), ("unwrap",), ("--no-normalize",), ".obj")
    assert judge(case, source, target, said, "") == []
    document = formats.read(str(target))
    uvmap = document.uv()
    folded = UVMap(np.abs(uvmap.uv - uvmap.uv.mean(0)), uvmap.uv_faces)
    formats.write(target, document, folded, overwrite=True)
    found = judge(case, source, target, said, "")
    assert any("overlap" in line for line in found), found


def test_triangles_that_touch_do_not_overlap() -> None:
    p, f = shapes.delaunay_disk(60)
    assert overlapping(p[f][:, :, :2], 1e-9) is None
    moved = p[f][:, :, :2].copy()
    moved[5] = moved[9]
    assert overlapping(moved, 1e-9) is not None


def test_degenerate_faces_and_twins_are_not_live() -> None:
    p = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    f = np.array([[0, 1, 2], [2, 1, 0], [0, 1, 3], [0, 0, 1]])
    assert live_faces(p * 1e-30, f).tolist() == [0]


# a hook stays for good; it notes the files that are opened while there is a list here
_OPENED: list[list[str]] = []


def _hear(event: str, given: tuple[object, ...]) -> None:
    if event == "open" and _OPENED and isinstance(given[0], str):
        _OPENED[-1].append(given[0])


@needs_alarm
def test_hostile_files_end_in_one_line_and_open_nothing_else(tmp_path: Path) -> None:
    """The kinds that are quick; ``python -m tests.fuzz.hostile`` runs and measures all."""
    sys.addaudithook(_hear)
    folder = hostile.lay_out(tmp_path)
    _OPENED.append([])
    try:
        for kind in hostile.kinds():
            if kind.slow:
                continue
            over: list[bool] = []
            with bounded(30.0, over):
                result = CliRunner().invoke(cli, hostile.words_of(kind, folder))
            assert not over, kind.name
            assert result.exit_code in ALLOWED, (kind.name, result.stderr)
            assert result.stderr.count("\n") == bool(result.exit_code), (kind.name, result.stderr)
        heard = _OPENED[-1]
    finally:
        _OPENED.clear()
    assert any(name.endswith("cut.glb") for name in heard)  # the hook hears
    assert hostile.opened_outside(heard, folder) == []
