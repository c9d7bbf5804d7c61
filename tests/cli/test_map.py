"""``circparam map``: the file, the report, and errors with their codes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from circparam.cli import cli
from circparam.formats.io import read
from circparam.maps import load_map
from circparam.mesh.mesh import Mesh
from tests.cli.test_unwrap import obj, one_line_error
from tests.support import pairs, shapes


def run(*args: object) -> Result:
    return CliRunner().invoke(cli, ["map", *map(str, args)])


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    a, b = pairs.blob(2, 1), pairs.blob(2, 1, turned=5)
    for name, mesh in (("a", a), ("b", b)):
        obj(tmp_path / f"{name}.obj", (mesh.points, mesh.faces))
    text = "# A B\n" + "".join(f"{u}, {v}\n" for u, v in pairs.marks(a, b).tolist())
    (tmp_path / "pairs.txt").write_text(text)
    return tmp_path / "a.obj", tmp_path / "b.obj", tmp_path / "pairs.txt"


def test_a_map_is_written_and_reported(files, tmp_path: Path) -> None:
    a, b, marks = files
    result = run(a, b, "--landmarks", marks, "-o", tmp_path / "m.npz", "--json", "-q")
    assert result.exit_code == 0, result.stderr
    got = json.loads(result.stdout)
    assert got["schema"] == "circparam/map/1"
    assert got["inversions"] == {"a": 0, "b": 0}
    assert got["landmarks"] == 8
    assert got["landmark_error"] <= 1e-9
    for way in ("a_to_b", "b_to_a"):
        d = got["distortion"][way]
        assert 1 <= d["mean"] <= 1.1
        assert d["p95"] <= d["p99"] <= d["max"]
    found, first, second = load_map(tmp_path / "m.npz"), read(a).mesh, read(b).mesh
    found.check(first, second)
    image = found.to_b.of(second.points, second.faces)
    size = np.linalg.norm(np.ptp(first.points, axis=0))
    assert np.linalg.norm(image - first.points, axis=1).mean() < 0.01 * size


def test_the_table_tells_both_ways(files, tmp_path: Path) -> None:
    a, b, marks = files
    result = run(a, b, "--landmarks", marks, "-o", tmp_path / "m.npz")
    assert result.exit_code == 0
    for word in ("A to B", "B to A", "inversions", "landmarks"):
        assert word in result.stdout


def test_errors_are_one_line_with_a_code(files, tmp_path: Path) -> None:
    a, b, marks = files
    out = tmp_path / "m.npz"
    one_line_error(run(a, b, "-o", tmp_path / "m.txt"), 2, ".npz")
    one_line_error(
        run(a, b, "-o", out, "--method", "harmonic"), 2, "of circle, mean-value, floater, uniform."
    )
    one_line_error(run(a, tmp_path / "none.obj", "-o", out), 3, "none.obj")
    (tmp_path / "bad.txt").write_text("1 2\n3 x\n")
    one_line_error(run(a, b, "-o", out, "--landmarks", tmp_path / "bad.txt"), 3, "line 2")
    obj(tmp_path / "disk.obj", shapes.grid())
    one_line_error(run(a, tmp_path / "disk.obj", "-o", out), 4, "boundaries")
    mirror = read(b).mesh
    obj(tmp_path / "mirror.obj", (mirror.points * [1, 1, -1], mirror.faces[:, ::-1]))
    one_line_error(
        run(a, tmp_path / "mirror.obj", "--landmarks", marks, "-o", out), 4, "--mirrored"
    )
    assert not out.exists()
    out.write_text("old")
    one_line_error(run(a, b, "-o", out), 2, "--overwrite")
    assert out.read_text() == "old"
    assert isinstance(mirror, Mesh)
