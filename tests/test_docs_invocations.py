"""The invocations of README and docs run, quickly, on small meshes under the names that they use."""

import glob
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from PIL import Image

from circparam.cli import cli
from tests.support import shapes
from tests.support.writers import obj
from tests.test_docs import ROOT, console_commands, quickened

PAGES = ("README.md", "docs/cli.md", "docs/maps.md", "docs/blender.md")
# a bucket, a cluster, processes, a placeholder; what takes seconds or wants a layout of its own, and is run by
# tests/compare/test_kim2019.py, tests/bake/test_across.py, tests/maps/test_charts.py and test_lods.py
ELSEWHERE = (
    "s3://", "tcp://", " batch ", " transfer ", "COMMAND", "compare --methods", "compare *.obj",
    "--cage 0.05", "--charts", "--map a_to_b", "--map nearest",
)  # fmt: skip
OBJ = (
    "mesh", "disk", "mesh_uv", "a", "b", "left", "a_uv", "b_uv", "spot", "spot_uv", "low_uv", "scan",
)  # fmt: skip


def lines() -> list[str]:
    """Every line of a block of these pages that is a command with its arguments."""
    out = []
    for page in PAGES:
        text = (ROOT / page).read_text("utf-8")
        for block in re.findall(r"```(?:\w*)\n(.*?)```", text, re.S):
            for line in block.splitlines():
                if not re.match(r"( {4})?circparam ", line):
                    continue
                typed = re.sub(r"\s{3,}\S.*$|\s+#.*$", "", line.strip())
                if re.match(r"circparam [a-z]+ \S", typed):
                    out.append(typed)
    return sorted({line for line in out if not any(word in f"{line} " for word in ELSEWHERE)})


def write(path: Path, points: np.ndarray, faces: np.ndarray, uv: np.ndarray, **names: Any) -> None:
    """An OBJ whose faces are of the material t, or of those that are named."""
    materials = names or {"t": np.ones(len(faces), bool)}
    path.write_bytes(obj(points, faces, uv, materials=materials, library="t.mtl"))


def ran(typed: str) -> None:
    """Run a line as a shell would: parts joined by &&, stars, < and >."""
    for part in typed.split("&&"):
        words = shlex.split(part)
        told = None
        for sign in ("<", ">"):
            if sign in words:
                at = words.index(sign)
                name, words = words[at + 1], words[:at] + words[at + 2 :]
                told = Path(name).read_bytes() if sign == "<" else told
        args = [f for word in words[1:] for f in (sorted(glob.glob(word)) or [word])]
        result = CliRunner().invoke(cli, quickened(args), input=told)
        assert result.exit_code == 0, (args, result.stderr)
        if "-o" in args:
            assert Path(args[args.index("-o") + 1]).is_file(), args


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Small files under all the names that the pages use."""
    out = tmp_path_factory.mktemp("named")
    points, faces = shapes.grid(7, 7)
    points = points + 0.1 * np.sin(3 * points[:, :1]) * [0, 0, 1]
    uv = 0.02 + 0.96 * (points[:, :2] - points[:, :2].min(0)) / np.ptp(points[:, :2], axis=0).max()
    for name in OBJ:
        write(out / f"{name}.obj", points, faces, uv)
    first = np.arange(2 * len(faces)) < len(faces)
    two, left = shapes.join((points, faces), (points + 2, faces)), uv * [0.4, 0.4]
    write(
        out / "parts.obj",
        *two,
        np.concatenate([left, left + np.array([0.5, 0])]),
        t=first,
        face=~first,
    )
    write(out / "right.obj", points * [-1, 1, 1], faces[:, ::-1], uv)
    (out / "t.mtl").write_text("newmtl t\nmap_Kd t.png\n")
    Image.new("RGB", (16, 16), (200, 80, 20)).save(out / "t.png")
    colours = np.full((len(points), 3), [200, 90, 10], np.uint8)
    scan = trimesh.Trimesh(points, faces, vertex_colors=colours, process=False)
    for name in ("scan", "remeshed", "high"):
        scan.export(out / f"{name}.ply", encoding="ascii")
    trimesh.Trimesh(points, faces).export(out / "mesh.stl")
    (out / "pairs.txt").write_text("8 8\n12 12\n36 36\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(out)
        ran("circparam unwrap scan.ply -o scan_uv.ply --effort 0.01 -q")
        ran("circparam bake disk.obj --from texture --source scan.obj --size 16 -o mesh.glb -q")
        ran("circparam unwrap mesh.glb --lightmap -o model.glb --effort 0.01 -q")
        for name in ("mesh_uv", "model_uv", "a_uv", "b"):
            shutil.copy("mesh.glb", f"{name}.glb")
        ran("circparam map a.obj b.obj -o map.npz -q")
        shutil.copy("map.npz", "a_to_b.npz")
        ran("circparam morph a.obj b.obj --map map.npz -o morph.glb -q")
    return out


@pytest.mark.parametrize("typed", lines())
def test_an_invocation_runs_as_typed(typed, folder, tmp_path, monkeypatch):
    if "xatlas" in typed:
        pytest.importorskip("xatlas")
    here = tmp_path / "here"
    shutil.copytree(folder, here)
    monkeypatch.chdir(here)
    made = re.search(r"-o (\S+)", typed)
    if made is not None:
        Path(made[1]).unlink(missing_ok=True)
    own = re.search(r"circparam (?:unwrap|pack) (\w+)\.(\w+)", typed)
    if own is not None and made is None:
        Path(f"{own[1]}_uv.{own[2]}").unlink(missing_ok=True)
    for other in OBJ if "*.obj" in typed else ():
        if other != "mesh":
            Path(f"{other}.obj").unlink()
    ran(typed)


def test_sixty_invocations_are_tried() -> None:
    """With the pages that are walked through as a whole (``tests/test_docs.py``)."""
    walked = [
        c
        for page in ("tutorial.md", "two-surfaces.md")
        for c in console_commands(ROOT / "docs" / page)
    ]
    assert len(lines()) >= 35
    assert len(lines()) + len({tuple(c) for c in walked}) >= 60
