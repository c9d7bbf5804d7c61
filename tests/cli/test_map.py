"""``circparam map``: the file, the report, and errors with their codes."""

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
from tests.support import pairs, shapes, tori
from tests.support.baking import write_obj


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


def test_handles_by_paths_charts_and_overlay(tmp_path: Path) -> None:
    """A torus: paths in the file of landmarks, charts that correspond, and the overlay with its morph."""
    one, layout = tori.patchwork(16, 9, 4, 3)
    two, other = tori.patchwork(20, 12, 4, 3)
    for name, mesh, uv in (("a", one, layout), ("b", two, other)):
        write_obj(tmp_path / f"{name}.obj", mesh.points, uv, mesh.faces)
    a, b = tmp_path / "a.obj", tmp_path / "b.obj"
    marks = tori.marks(one, two)
    rows = [f"{u} {v}" for u, v in marks.tolist()]
    rows += [f"path {marks[0, 0]} {marks[1, 0]} {marks[2, 0]} {marks[0, 0]}  # round the tube"]
    (tmp_path / "pairs.txt").write_text("\n".join(rows))
    out = tmp_path / "m.npz"
    done = run(a, b, "--landmarks", tmp_path / "pairs.txt", "--overlay", "-o", out, "--json", "-q")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["inversions"] == {"a": 0, "b": 0}
    assert load_map(out).overlay is not None
    words = ["morph", a, b, "--map", out, "--overlay", "-o", tmp_path / "m.glb", "--json", "-q"]
    made = CliRunner().invoke(cli, [str(w) for w in words])
    assert made.exit_code == 0, made.stderr
    assert json.loads(made.stdout)["faces"] == len(load_map(out).overlay.faces)
    charts = run(a, b, "--charts", "--landmarks", tmp_path / "pairs.txt", "-o", tmp_path / "c.npz")
    one_line_error(charts, 2, "leave one out")
    (tmp_path / "pairs.txt").write_text("\n".join(rows[:-1]))
    charts = run(a, b, "--charts", "--landmarks", tmp_path / "pairs.txt", "-o", tmp_path / "c.npz")
    assert charts.exit_code == 0, charts.stderr
    one_line_error(run(a, b, "--charts", "-o", tmp_path / "d.npz"), 3, "correspond in 24 ways")
    plate = tori.plate(2)
    obj(tmp_path / "plate.obj", (plate.points, plate.faces))
    one_line_error(run(a, tmp_path / "plate.obj", "-o", tmp_path / "d.npz"), 4, "genus 1 and B 2")


def test_single_triangles_are_mapped_and_lines_refused_by_name(tmp_path: Path) -> None:
    """No vertex is free then: that was a warning of NumPy on the screen."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    for name, scale in (("a", 1.0), ("b", 2.0)):
        obj(tmp_path / f"{name}.obj", (corners * [scale, 1, 1], np.array([[0, 1, 2]])))
    out = tmp_path / "m.npz"
    result = run(tmp_path / "a.obj", tmp_path / "b.obj", "-o", out)
    assert result.exit_code == 0, result.stderr
    assert "0 given" in result.stdout
    np.testing.assert_allclose(load_map(out).to_b.weights.max(1), 1)
    obj(tmp_path / "line.obj", (corners * [1, 0, 0], np.array([[0, 1, 2]])))
    words = ("-o", out, "--overwrite")
    one_line_error(
        run(tmp_path / "a.obj", tmp_path / "line.obj", *words), 3, "B: its 1 face is degenerate"
    )
