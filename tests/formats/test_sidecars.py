"""Small text files: read as written, refused with the line that is wrong."""

from pathlib import Path

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats import sidecars


def file(tmp_path: Path, text: str | bytes, name: str = "f.txt") -> Path:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_pins(tmp_path: Path) -> None:
    path = file(tmp_path, "# vertex u v\n3 0.5 0.25\n\n7, 1, -2e-1  # a corner\n")
    np.testing.assert_array_equal(sidecars.read_pins(path), [[3, 0.5, 0.25], [7, 1, -0.2]])


def test_a_byte_order_mark_is_no_number(tmp_path: Path) -> None:
    """Windows' editors write one before the first line."""
    text = "0 4\r\n4 9\r\n".encode("utf-8-sig")
    np.testing.assert_array_equal(sidecars.read_landmarks(file(tmp_path, text)), [[0, 4], [4, 9]])
    np.testing.assert_array_equal(sidecars.read_seams(file(tmp_path, text)), [[0, 4], [4, 9]])


def test_seams_as_pairs_and_as_lines(tmp_path: Path) -> None:
    np.testing.assert_array_equal(
        sidecars.read_seams(file(tmp_path, "0 4\n4 9\n")), [[0, 4], [4, 9]]
    )
    obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3\nl -1 1/5\n"
    got = sidecars.read_seams(file(tmp_path, obj, "seams.obj"))
    np.testing.assert_array_equal(got, [[0, 1], [1, 2], [2, 0]])


def test_seams_come_back_as_written(tmp_path: Path) -> None:
    pairs = np.array([[0, 4], [4, 9], [2, 1000000]])
    sidecars.write_seams(tmp_path / "s.txt", pairs)
    np.testing.assert_array_equal(sidecars.read_seams(tmp_path / "s.txt"), pairs)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("1 2\n", "line 1"),
        ("1 0 0\n2 0 x\n", "line 2"),
        ("1 0 nan\n", "line 1"),
        ("1 0 0\n1.5 0 0\n", "line 2: 1.5 is not a vertex number"),
        ("1e30 0 0\n", "line 1: 1e\\+30 is not a vertex number"),
        ("-99999999999999999999 0 0\n", "not a vertex number"),
        ("# nothing\n", "no line"),
        (b"\xff\xfe\x00", "not a text file"),
    ],
)
def test_bad_pins(tmp_path: Path, text: str | bytes, word: str) -> None:
    with pytest.raises(InputError, match=word):
        sidecars.read_pins(file(tmp_path, text))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("number", ["1e30", "99999999999999999999", "-1e300"])
def test_numbers_beyond_any_vertex_are_named(tmp_path: Path, number: str) -> None:
    for read in (sidecars.read_landmarks, sidecars.read_seams):
        with pytest.raises(InputError, match=r"1e\+.* is not a vertex number"):
            read(file(tmp_path, f"0 1\n2 {number}\n"))


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        sidecars.read_seams(tmp_path / "none.txt")
    with pytest.raises(InputError, match="directory"):
        sidecars.read_seams(tmp_path)
