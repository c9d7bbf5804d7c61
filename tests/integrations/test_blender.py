"""The add-on: the zip file that Blender installs, and a scene unwrapped in Blender itself where there is one.

CIRCPARAM_BPY names a Python that has Blender's module (``pip install bpy``); without it, and where this Python
has none, the tests inside Blender are skipped.
"""

from __future__ import annotations

import ast
import importlib.util
import io
import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from circparam._version import __version__
from circparam.cli import cli
from circparam.integrations.blender import FOLDER, addon_zip

ROOT = Path(__file__).parents[2]


def test_the_zip_is_what_blender_installs() -> None:
    data = addon_zip()
    assert data == addon_zip()
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert sorted(archive.namelist()) == [
            f"{FOLDER}/__init__.py", f"{FOLDER}/blender_manifest.toml"
        ]  # fmt: skip
        manifest = tomllib.loads(archive.read(f"{FOLDER}/blender_manifest.toml").decode())
        code = archive.read(f"{FOLDER}/__init__.py").decode()
    assert (manifest["id"], manifest["version"]) == (FOLDER, __version__)
    modules = {
        (node.module or "").split(".")[0]
        if isinstance(node, ast.ImportFrom)
        else alias.name.split(".")[0]
        for node in ast.walk(ast.parse(code))
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
    }
    assert modules <= {"bpy", "numpy", *sys.stdlib_module_names}


def test_the_command_saves_it(tmp_path: Path) -> None:
    path = tmp_path / "ein Ordner ü.zip"
    run = CliRunner().invoke
    assert run(cli, ["blender", "-o", str(path)]).exit_code == 0
    assert path.read_bytes() == addon_zip()
    again = run(cli, ["blender", "-o", str(path)])
    assert (again.exit_code, "--overwrite" in again.stderr) == (2, True)
    other = run(cli, ["blender", "-o", str(tmp_path / "a.py")])
    assert (other.exit_code, ".zip" in other.stderr) == (2, True)
    assert run(cli, ["blender", "-o", str(tmp_path / "none" / "a.zip")]).exit_code != 0


def blender() -> str | None:
    named = os.environ.get("CIRCPARAM_BPY")
    return named or (sys.executable if importlib.util.find_spec("bpy") else None)


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    python = blender()
    if python is None:
        pytest.skip("no Blender: name a Python with bpy in CIRCPARAM_BPY")
    folder = tmp_path_factory.mktemp("blender")
    (folder / "addon.zip").write_bytes(addon_zip())
    program = folder / "circparam program"
    program.write_text(
        f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -P -m circparam "$@"\n', "utf-8"
    )
    program.chmod(0o755)
    script = Path(__file__).with_name("in_blender.py")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [python, str(script), str(folder / "addon.zip"), str(program)],
        capture_output=True, text=True, timeout=600, env={**environment, "HOME": str(folder)},
    )  # fmt: skip
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    assert lines, done.stdout[-2000:] + done.stderr[-2000:]
    return dict(json.loads(lines[0].removeprefix("RESULT ")))


NAMES = ("cube", "cylinder", "monkey")


@pytest.mark.parametrize("name", NAMES)
def test_everything_else_of_the_object_stays(answer: dict[str, Any], name: str) -> None:
    before, after = answer["before"][name], answer["after"][name]
    for what in ("polygons", "materials", "names", "points", "edges"):
        assert before[what] == after[what], what
    for other, uv in before["maps"].items():
        assert after["maps"][other] == uv
    assert after["active"] == "circparam"
    assert answer["answer"] == ["FINISHED"]


@pytest.mark.parametrize("name", NAMES)
def test_the_layout_is_one_to_one_and_in_the_page(answer: dict[str, Any], name: str) -> None:
    after = answer["after"][name]
    uv = np.array(after["maps"]["circparam"])
    assert uv.min() >= 0
    assert uv.max() <= 1
    size = [len(p) for p in after["polygons"]]
    rings = np.split(uv, np.cumsum(size)[:-1])
    areas = np.array([
        0.5 * (r[:, 0] * np.roll(r[:, 1], -1) - r[:, 1] * np.roll(r[:, 0], -1)).sum() for r in rings
    ])  # fmt: skip
    assert (
        areas > 0
    ).all()  # as Blender's own unwrapping: in the data, whatever the object's scale


@pytest.mark.parametrize("name", NAMES)
def test_seams_are_marked_where_the_uv_part(answer: dict[str, Any], name: str) -> None:
    after = answer["after"][name]
    uv = np.array(after["maps"]["circparam"])
    sides: dict[tuple[int, int], set[tuple[float, ...]]] = {}
    start = 0
    for polygon in after["polygons"]:
        k = len(polygon)
        for i in range(k):
            a, b = polygon[i], polygon[(i + 1) % k]
            at = [start + i, start + (i + 1) % k]
            at = at if a < b else at[::-1]
            sides.setdefault((min(a, b), max(a, b)), set()).add(tuple(uv[at].ravel()))
        start += k
    marked = {
        tuple(sorted(e)) for e, seam in zip(after["edges"], after["seams"], strict=True) if seam
    }
    assert marked == {edge for edge, values in sides.items() if len(values) > 1}
    assert marked


def test_what_is_wrong_is_said_in_one_line(answer: dict[str, Any]) -> None:
    assert "no such program" in answer["missing"][0]
    assert "--padding 4000" in answer["refused"][0]
