"""``circparam map``: the file, the report, and errors that depend on what was given."""

from pathlib import Path

import numpy as np

from circparam.formats.io import read
from circparam.maps import load_map
from tests.support import pairs, tori
from tests.support.baking import write_obj
from tests.support.command_line import done, obj, one_line_error, report, run


def test_a_map_is_written_and_reported(tmp_path: Path) -> None:
    one, two = pairs.blob(2, 1), pairs.blob(2, 1, turned=5)
    a, b = (obj(tmp_path / f"{k}.obj", (m.points, m.faces)) for k, m in (("a", one), ("b", two)))
    marks, out = tmp_path / "pairs.txt", tmp_path / "m.npz"
    marks.write_text("# A B\n" + "".join(f"{u}, {v}\n" for u, v in pairs.marks(one, two).tolist()))
    words = ("map", a, b, "--landmarks", marks, "-o", out)
    got = report(*words, "-q")
    assert got["schema"] == "circparam/map/1"
    assert (got["inversions"], got["landmarks"]) == ({"a": 0, "b": 0}, 8)
    assert got["landmark_error"] <= 1e-9
    for way in ("a_to_b", "b_to_a"):
        d = got["distortion"][way]
        assert 1 <= d["mean"] <= 1.1
        assert d["mean"] <= d["p95"] <= d["p99"] <= d["max"]
    found, first, second = load_map(out), read(a).mesh, read(b).mesh
    found.check(first, second)
    image = found.to_b.of(second.points, second.faces)
    size = np.linalg.norm(np.ptp(first.points, axis=0))
    assert np.linalg.norm(image - first.points, axis=1).mean() < 0.01 * size
    table = run(*words, "--overwrite").stdout
    for word in ("A to B", "B to A", "inversions", "landmarks"):
        assert word in table


def test_handles_by_paths_charts_and_overlay(tmp_path: Path) -> None:
    """A torus: paths in the file of landmarks, charts that correspond, and the overlay with its morph."""
    one, layout = tori.patchwork(16, 9, 4, 3)
    two, other = tori.patchwork(20, 12, 4, 3)
    a, b, pairs_file = (tmp_path / name for name in ("a.obj", "b.obj", "pairs.txt"))
    for path, mesh, uv in ((a, one, layout), (b, two, other)):
        write_obj(path, mesh.points, uv, mesh.faces)
    marks = tori.marks(one, two)
    rows = [f"{u} {v}" for u, v in marks.tolist()]
    path = f"path {marks[0, 0]} {marks[1, 0]} {marks[2, 0]} {marks[0, 0]}  # round the tube"
    pairs_file.write_text("\n".join([*rows, path]))
    out, morphed = tmp_path / "m.npz", tmp_path / "m.glb"
    done = report("map", a, b, "--landmarks", pairs_file, "--overlay", "-o", out, "-q")
    assert done["inversions"] == {"a": 0, "b": 0}
    assert load_map(out).overlay is not None
    made = report("morph", a, b, "--map", out, "--overlay", "-o", morphed, "-q")
    assert made["faces"] == len(load_map(out).overlay.faces)
    charts = ("map", a, b, "--charts", "-o", tmp_path / "c.npz")
    one_line_error(run(*charts, "--landmarks", pairs_file), 2, "leave one out")
    one_line_error(run(*charts), 3, "correspond in 24 ways")
    pairs_file.write_text("\n".join(rows))
    assert run(*charts, "--landmarks", pairs_file).exit_code == 0


def test_single_triangles_are_mapped(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    a, b = (
        obj(tmp_path / f"{k}.obj", (corners * [k, 1, 1], np.array([[0, 1, 2]]))) for k in (1, 2)
    )
    result = done("map", a, b, "-o", tmp_path / "m.npz")
    assert "warning" not in result.stderr.lower()
    assert "0 given" in result.stdout
    np.testing.assert_allclose(load_map(tmp_path / "m.npz").to_b.weights.max(1), 1)
