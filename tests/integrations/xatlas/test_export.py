"""``export`` of circparam.xatlas writes what xatlas writes."""

from pathlib import Path

import numpy as np
import pytest

from circparam import xatlas as ours
from circparam.errors import OptionError, OutputError
from tests.support import shapes

P, F = shapes.cube(1)
UV = P[:, :2] + 0.5
N = P * 2


@pytest.mark.parametrize(
    "arrays",
    [(P,), (P, F), (P, F, UV), (P, F, None, N), (P, F, UV, N), (P, None, UV)],
    ids=["points", "faces", "uv", "normals", "all", "points and uv"],
)
def test_the_file_says_what_that_of_xatlas_says(arrays: tuple, tmp_path: Path) -> None:
    theirs = pytest.importorskip("xatlas", reason="the baseline is not installed")
    said = []
    for name, package in (("a.obj", theirs), ("b.obj", ours)):
        package.export(str(tmp_path / name), *arrays)
        rows = [line.split() for line in (tmp_path / name).read_text().splitlines() if line]
        of_word = {word: [r[1:] for r in rows if r[0] == word] for word in ("v", "vt", "vn")}
        said.append(
            {word: np.array(values, np.float32).tolist() for word, values in of_word.items()}
        )
        said[-1]["f"] = [r[1:] for r in rows if r[0] == "f"]
    assert said[0] == said[1]


def test_numbers_are_read_back_to_the_last_bit(rng: np.random.Generator, tmp_path: Path) -> None:
    points = (rng.normal(size=(50, 3)) * 10.0 ** rng.integers(-20, 20, (50, 1))).astype(np.float32)
    ours.export(tmp_path / "p.obj", points)
    rows = [line.split()[1:] for line in (tmp_path / "p.obj").read_text().splitlines()]
    np.testing.assert_array_equal(np.array(rows, np.float32), points)


def test_errors_leave_no_file_and_replace_none(tmp_path: Path) -> None:
    kept = tmp_path / "kept.obj"
    kept.write_text("v 0 0 0\n")
    for bad, kind in (
        ((P[:, :2],), ValueError),
        ((P, F, UV[:3]), ValueError),
        ((P, F + 9), RuntimeError),
    ):
        with pytest.raises(kind):
            ours.export(kept, *bad)
    assert kept.read_text() == "v 0 0 0\n"
    with pytest.raises(OptionError, match="name it"):
        ours.export(tmp_path / "a.glb", P, F)
    with pytest.raises(OutputError):
        ours.export(tmp_path / "nowhere" / "a.obj", P, F)
    assert [p.name for p in tmp_path.iterdir()] == ["kept.obj"]
