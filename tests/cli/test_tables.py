"""Tables: 80 columns where there is no terminal, plain text, every value in its place."""

import io
import subprocess
import sys
from typing import Any

from circparam.cli.tables import check_line, check_table, console, unwrap_table


def text(table: Any) -> str:
    stream = io.StringIO()
    console(file=stream).print(table)
    return stream.getvalue()


REPORT: dict[str, Any] = {
    **{
        "status": "repaired",
        "input": "a[1].obj",
        "output": None,
        "method": "circle",
        "cut": "disk",
    },
    **{"charts": 2, "faces": 9, "flips": 0, "overlap": 3, "distortion": 1.25, "pages": 2},
    **{"distortion_max_chart": 1e300, "seam_length": 20000.0, "pack": 0.756, "seconds": 1.239},
    **{"stretch_p95": 1.1, "stretch_p99": 1.3, "stretch_p999": 1.9},
    **{"repairs": ["split [b] vertices"], "stages": {"solve": 0.5}, "notes": ["all is well"]},
}


def test_an_unwrap() -> None:
    got = text(unwrap_table(REPORT))
    assert "[" not in got.replace("a[1].obj", "").replace("[b]", "")  # names are no markup
    for said in (
        "(in memory)",
        "circle, cut disk",
        "2 of 9 faces",
        "0, 3",
        "75.6 % of 2 pages",
        "1.24 s",
    ):
        assert said in got
    assert "1.2500 (worst chart infinite" in " ".join(got.split())
    assert "2e+04 x sqrt(area)" in got
    assert "at most 1.1 on 95 %, 1.3 on 99 %, 1.9 on 99.9 %" in " ".join(got.split())
    assert "solve" not in got
    assert "all is well" not in got
    assert "0.500 s" in text(unwrap_table(REPORT, 1))
    assert "all is well" in text(unwrap_table(REPORT, 2))
    assert "packed" not in text(unwrap_table(REPORT | {"pack": None}))
    assert "75.6 % of the page" in text(unwrap_table(REPORT | {"pages": 1}))
    unknown = " ".join(text(unwrap_table(REPORT | {"distortion": None})).split())
    assert "distortion - (worst chart infinite" in unknown


def check_report(parts: int) -> dict[str, Any]:
    part = {"verdict": "disk", "faces": 5, "boundary_lengths": [1.0, 2, 3, 4, 5]}
    numbers = ("vertices", "edges", "faces", "euler", "boundaries", "degenerate_faces")
    zero = ("nonmanifold_edges", "nonmanifold_vertices", "inconsistent_edges", "duplicate_faces")
    return {
        **{"input": "m.obj", "format": "obj", "unreferenced_vertices": 4, "genus": None},
        **dict.fromkeys(numbers, 7),
        **dict.fromkeys(zero, 0),
        **{"component_list": [part] * parts, "uv_sets": [0, 2], "uv": None},
    }


def test_a_check_names_defects_that_are_there_and_no_others() -> None:
    got = text(check_table(check_report(1)))
    assert "7 and 4 that no face uses" in got
    assert "7, -" in got  # no genus
    assert "degenerate faces" in got
    assert "duplicate faces" not in got
    assert "boundaries of length 1, 2, 3, 4, ..." in " ".join(got.split())
    assert "2 (numbers 0, 2)" in got
    one = check_report(1) | {"uv_sets": [0]}
    assert "1 (number 0)" in text(check_table(one))  # a 0 alone looked like none
    assert check_line(one).endswith("1 uv set (number 0)")
    assert "none" in text(check_table(one | {"uv_sets": []}))


def test_a_closed_pipe_is_one_line() -> None:
    """The reader is gone before a table is written."""
    words = [sys.executable, "-m", "circparam", "methods"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        error = process.stderr.read()
    assert error == b"circparam: error: standard output was closed before everything was written\n"
    assert process.returncode == 8
