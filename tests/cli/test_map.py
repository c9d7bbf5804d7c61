"""``circparam map`` and ``morph``: files, reports and errors; odd names, and folders in the place of files."""

import json
import os
from pathlib import Path

import numpy as np

from circparam.formats.io import read
from circparam.maps import load_map
from tests.support import pairs, tori
from tests.support.baking import write_obj
from tests.support.command_line import done, obj, one_line_error, report, run
from tests.support.maps import written_belts


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


def test_a_morph_and_its_figures(tmp_path: Path):
    a, b, mapped = written_belts(tmp_path)
    out = tmp_path / "out.glb"
    words = ("morph", a, b, "--map", mapped, "-o", out)
    result = done(*words)
    assert result.stdout.strip() == str(out)
    first = out.read_bytes()
    one_line_error(run(*words), 2, "--overwrite")
    assert out.read_bytes() == first
    got = report(*words, "--overwrite", "--frames", 4)
    assert (got["schema"], got["frames"]) == ("circparam/morph/1", 4)
    assert (got["faces"], got["reversed"]) == (144, 0)
    assert 0 < got["moved_mean"] < got["moved_max"] < 0.1
    assert len(out.read_bytes()) < len(first)  # fewer key frames
    assert "morph targets" in read(out).features
    assert np.isfinite(read(out).mesh.points).all()


NAME = "sp ace ü 数 'quoted' #1 %20"


def written(folder: Path, tail: str = "") -> dict[str, Path]:
    """Two meshes with uv and the map between both."""
    found = dict(zip("abm", written_belts(folder, tail), strict=True))
    return found | {"out": folder / f"out{tail}.glb", "png": folder / f"png{tail}.png"}


def commands(n: dict[str, Path]) -> dict[str, list[object]]:
    return {
        "map": ["map", n["a"], n["b"], "-o", n["m"], "--overwrite"],
        "morph": ["morph", n["a"], n["b"], "--map", n["m"], "-o", n["out"]],
        "bake": [
            *("bake", n["a"], "--from", "normals", "--source", n["b"], "--size", 32),
            *("--map", n["m"], "-o", n["png"]),
        ],
    }


def test_any_name_will_do(tmp_path: Path) -> None:
    """Read, written, drawn and reported by every command; JSON stays UTF-8, for a name that is none too."""
    name = NAME + os.fsdecode(b"odd\xff")
    try:
        (tmp_path / name).mkdir()
    except (OSError, UnicodeError):  # the file system has no such names
        name = NAME
        (tmp_path / name).mkdir()
    folder = tmp_path / name
    names = written(folder, f" {name}")
    mesh, extra = names["a"], folder / name
    for words in commands(names).values():
        output = report(*words)["output"]
        assert Path(output[0] if isinstance(output, list) else output).stat().st_size > 100
    asked = (
        "--methods",
        "lscm",
        "--cut",
        "disk",
        "--report",
        f"{extra}.html",
        "--csv",
        f"{extra}.csv",
    )
    for words in (
        ("unwrap", mesh, "-o", f"{extra}.gltf", "--effort", "draft"),
        ("check", mesh, "--uv"),
        ("compare", mesh, *asked, "--plot", f"{extra}.png"),
    ):
        json.loads(done(*words, "--json").stdout_bytes.decode("utf-8"))
    done("view", f"{extra}.gltf", "-o", f"{extra}.svg")
    one_line_error(run("unwrap", f"{extra}-none.obj"), 3, "no such file")
