"""``circparam pack``: charts keep their shape, the page its padding."""

from pathlib import Path

import numpy as np

from circparam.formats.io import read
from tests.support import shapes
from tests.support.command_line import QUICK, done, obj, one_line_error, report, run
from tests.support.formats_tools import grid
from tests.support.gltf_files import small


def stacked(path: Path) -> Path:
    """Three flat squares of sizes 1, 2 and 3, whose uv lie on top of each other."""
    base, f = shapes.grid(3, 3)
    p, f = shapes.join(*[(base * s + [4 * s, 0, 0], f) for s in (1, 2, 3)])
    return obj(path, (p, f), p[:, :2] - np.repeat([[4.0, 0], [8, 0], [12, 0]], 9, 0))


def test_both_sides_of_a_sheet_keep_their_charts(tmp_path: Path) -> None:
    """One without uv is refused: tests/cli/test_refusals.py."""
    (p, f), mesh, out = shapes.grid(5, 5), tmp_path / "m.obj", tmp_path / "o.obj"
    obj(mesh, (p, f), np.r_[p[:, :2], p[:, :2] * [-1, 1]])
    backs = [" ".join(f"{k + 1}/{k + 26}" for k in face) for face in f[:, ::-1].tolist()]
    mesh.write_text(mesh.read_text() + "".join(f"f {face}\n" for face in backs))
    got = report("pack", mesh, "-o", out, *QUICK)
    assert (got["charts"], got["overlap"], got["mirrored"]) == (2, 0, 0)
    assert out.read_text().count("\nvt ") == 50
    assert run("check", out, "--uv").exit_code == 0


def test_default_output_overwrite_and_gates(tmp_path: Path) -> None:
    mesh = stacked(tmp_path / "m.obj")
    one_line_error(run("pack", mesh, "-q", *QUICK, "--fail-if", "charts>2"), 6, "charts>2")
    assert (tmp_path / "m_uv.obj").exists()
    one_line_error(run("pack", mesh, "-q", *QUICK), 2, "m_uv.obj", "--overwrite")
    assert run("pack", mesh, "-q", *QUICK, "--overwrite").exit_code == 0


def test_a_further_uv_set_is_packed_in_its_place(tmp_path: Path) -> None:
    scene = small()
    attributes = scene.tree["meshes"][0]["primitives"][0]["attributes"]
    uv = scene.accessor((0.5 * grid(3)[0][:, :2]).astype("f4"))
    attributes |= {"TEXCOORD_0": uv, "TEXCOORD_1": uv}
    mesh, out = tmp_path / "m.glb", tmp_path / "o.glb"
    mesh.write_bytes(scene.glb())
    done("pack", mesh, "--uv-set", "1", "-o", out, *QUICK)
    before, after = read(mesh).uv(0), read(out)
    kept, packed = after.uv(0), after.uv(1)
    np.testing.assert_array_equal(kept.uv[kept.uv_faces], before.uv[before.uv_faces])
    assert not np.array_equal(packed.uv[packed.uv_faces], before.uv[before.uv_faces])
