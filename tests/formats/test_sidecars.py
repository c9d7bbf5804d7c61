"""Small text files: read as written, refused with the line that is wrong."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats import sidecars

KINDS = {
    "pins": sidecars.read_pins,
    "landmarks": sidecars.read_landmarks,
    "seams": sidecars.read_seams,
    "weights": sidecars.read_weights,
}
MARK = "\ufeff"  # Windows' editors write one before the first line


def read(kind: str, text: str | bytes, folder: Path) -> Any:
    path = folder / "f.txt"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return KINDS[kind](path)


@pytest.mark.parametrize(
    ("kind", "text", "rows"),
    [
        ("pins", "# vertex u v\n3 0.5 0.25\n\n7, 1, -2e-1  # a corner\n", [[3, 0.5, 0.25], [7, 1, -0.2]]),
        ("landmarks", MARK + "0 4\r\n4 9\r\n", [[0, 4], [4, 9]]),
        ("seams", MARK + "0 4\r\n4 9\r\n", [[0, 4], [4, 9]]),
        ("seams", "v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3\nl -1 1/5\n", [[0, 1], [1, 2], [2, 0]]),
        ("weights", "3 4 0.5 # an edge\n7, never\n8 inf\n", [[3, 4, 0.5], [7, -1, np.inf], [8, -1, np.inf]]),
    ],
)  # fmt: skip
def test_rows_are_read_as_written(kind: str, text: str, rows: object, tmp_path: Path) -> None:
    np.testing.assert_array_equal(read(kind, text, tmp_path), rows)


def test_seams_come_back_as_written(tmp_path: Path) -> None:
    pairs = np.array([[0, 4], [4, 9], [2, 1000000]])
    sidecars.write_seams(tmp_path / "s.txt", pairs)
    np.testing.assert_array_equal(sidecars.read_seams(tmp_path / "s.txt"), pairs)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("kind", "text", "word"),
    [
        ("pins", "1 2\n", "line 1"),
        ("pins", "1 0 0\n2 0 x\n", "line 2"),
        ("pins", "1 0 nan\n", "line 1"),
        ("pins", "1 0 0\n1.5 0 0\n", "line 2: 1.5 is not a vertex number"),
        ("pins", "1e30 0 0\n", "line 1: 1e\\+30 is not a vertex number"),
        ("pins", "# nothing\n", "no line"),
        ("pins", b"\xff\xfe\x00", "not a text file"),
        *(
            (kind, f"0 1\n2 {number}\n", "line 2: -?1e\\+.* is not a vertex number")
            for kind in ("landmarks", "seams")
            for number in ("1e30", "99999999999999999999", "-1e300")
        ),
        ("weights", "1 2 1\n0 1 -2\n", "line 2: the weight -2 is not a number from 0"),
        ("weights", "1 2 1\n0 nan\n", "the weight nan is not a number from 0"),
        ("weights", "1 2 1\n0 1 2 3\n", "not one or two vertex numbers"),
        ("weights", "1 2 1\n0 x\n", "not one or two vertex numbers"),
        ("weights", "# nothing\n", "no line"),
    ],
)
def test_a_line_that_is_wrong_is_named(kind: str, text: str, word: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=word):
        read(kind, text, tmp_path)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        sidecars.read_seams(tmp_path / "none.txt")
    with pytest.raises(InputError, match="directory"):
        sidecars.read_seams(tmp_path)
