"""``circparam pack``: charts keep their shape, the page its padding."""

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner, Result

from circparam.cli import cli
from circparam.formats.io import read
from tests.cli.test_check import with_uv
from tests.cli.test_unwrap import QUICK, obj, one_line_error
from tests.support import shapes
from tests.support.formats_tools import grid
from tests.support.gltf_files import small


def pack(*args: object) -> Result:
    return CliRunner().invoke(cli, ["pack", *map(str, args), *QUICK])


def stacked(path: Path) -> Path:
    """Three flat squares of sizes 1, 2 and 3, whose uv lie on top of each other."""
    base, f = shapes.grid(3, 3)
    p, f = shapes.join(*[(base * s + [4 * s, 0, 0], f) for s in (1, 2, 3)])
    uv = p[:, :2] - np.repeat([[4.0, 0], [8, 0], [12, 0]], 9, 0)
    return with_uv(path, uv, (p, f))


def test_charts_keep_shape_and_relative_size(tmp_path: Path) -> None:
    mesh = stacked(tmp_path / "m.obj")
    result = pack(mesh, "-o", tmp_path / "o.obj", "--json", "--resolution", "256")
    assert result.exit_code == 0, result.stderr
    got = json.loads(result.stdout)
    assert got["schema"] == "circparam/pack/1"
    assert (got["charts"], got["overlap"], got["mirrored"], got["flips"]) == (3, 0, 0, 0)
    assert got["gap_texels"] is None or got["gap_texels"] >= 5
    assert got["border_texels"] >= 4
    before, after = read(mesh), read(tmp_path / "o.obj")
    a, b = before.uv(0), after.uv(0)
    assert a is not None
    length = [
        np.linalg.norm(u.uv[u.uv_faces][:, [1, 2, 0]] - u.uv[u.uv_faces], axis=2) for u in (a, b)
    ]
    scale = length[1] / length[0]
    np.testing.assert_allclose(scale, scale[0, 0], rtol=1e-9)
    assert b.uv.min() >= 0
    assert b.uv.max() <= 1
    np.testing.assert_array_equal(before.mesh.points, after.mesh.points)


def two_sided(path: Path) -> Path:
    """A sheet with a side behind that has uv of its own."""
    p, f = shapes.grid(5, 5)
    with_uv(path, np.r_[p[:, :2], p[:, :2] * [-1, 1]], (p, f))
    backs = [" ".join(f"{k + 1}/{k + 26}" for k in face) for face in f[:, ::-1].tolist()]
    path.write_text(path.read_text() + "".join(f"f {face}\n" for face in backs))
    return path


def test_both_sides_of_a_sheet_keep_their_charts(tmp_path: Path) -> None:
    mesh = two_sided(tmp_path / "m.obj")
    result = pack(mesh, "-o", tmp_path / "o.obj", "--json")
    got = json.loads(result.stdout)
    assert (got["charts"], got["overlap"], got["mirrored"]) == (2, 0, 0)
    written = (tmp_path / "o.obj").read_text().splitlines()
    assert sum(line.startswith("vt ") for line in written) == 50
    assert CliRunner().invoke(cli, ["check", str(tmp_path / "o.obj"), "--uv"]).exit_code == 0


def test_a_back_without_uv_is_refused(tmp_path: Path) -> None:
    mesh = two_sided(tmp_path / "m.obj")
    head, last = mesh.read_text().rsplit("f ", 1)
    bare = " ".join(corner.split("/")[0] for corner in last.split())
    mesh.write_text(f"{head}f {bare}\n")
    one_line_error(pack(mesh, "-o", tmp_path / "o.obj"), 3, "without uv")


def test_default_output_and_overwrite(tmp_path: Path) -> None:
    mesh = stacked(tmp_path / "m.obj")
    assert pack(mesh, "-q").exit_code == 0
    assert (tmp_path / "m_uv.obj").exists()
    one_line_error(pack(mesh, "-q"), 2, "m_uv.obj", "--overwrite")


def test_a_further_uv_set_is_packed_in_its_place(tmp_path: Path) -> None:
    scene = small()
    attributes = scene.tree["meshes"][0]["primitives"][0]["attributes"]
    uv = scene.accessor((0.5 * grid(3)[0][:, :2]).astype("f4"))
    attributes |= {"TEXCOORD_0": uv, "TEXCOORD_1": uv}
    mesh, out = tmp_path / "m.glb", tmp_path / "o.glb"
    mesh.write_bytes(scene.glb())
    result = pack(mesh, "--uv-set", "1", "-o", out)
    assert result.exit_code == 0, result.stderr
    before, after = read(mesh).uv(0), read(out)
    kept, packed = after.uv(0), after.uv(1)
    np.testing.assert_array_equal(kept.uv[kept.uv_faces], before.uv[before.uv_faces])
    assert not np.array_equal(packed.uv[packed.uv_faces], before.uv[before.uv_faces])


def test_no_uv(tmp_path: Path) -> None:
    mesh = obj(tmp_path / "m.obj", shapes.grid())
    one_line_error(pack(mesh), 3, "m.obj", "no uv set 0 (there is none)")
    stacked(mesh)
    one_line_error(pack(mesh, "--uv-set", "2"), 3, "m.obj", "no uv set 2 (there is 0)")
    assert not (tmp_path / "m_uv.obj").exists()


def test_gates(tmp_path: Path) -> None:
    mesh = stacked(tmp_path / "m.obj")
    one_line_error(pack(mesh, "-q", "--fail-if", "charts>2"), 6, "charts>2")
    assert (tmp_path / "m_uv.obj").exists()


def test_padding_that_cannot_fit(tmp_path: Path) -> None:
    mesh = stacked(tmp_path / "m.obj")
    one_line_error(pack(mesh, "--padding", "40", "--resolution", "64"), 2, "padding")
