"""FBX is refused with the line that makes a GLB of it in Blender; the line works, where Blender is."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from circparam.errors import InputError
from circparam.formats.io import read


def expression(folder: Path) -> str:
    """What the message tells to run in Blender."""
    (folder / "mesh.fbx").write_bytes(b"Kaydara FBX Binary  \x00\x1a\x00 and so on")
    with pytest.raises(InputError) as caught:
        read(folder / "mesh.fbx")
    assert "\n" not in str(caught.value)
    found = re.search(r'blender -b --python-expr "([^"]+)"', str(caught.value))
    return found[1].replace("MESH", "mesh")


def test_the_page_on_formats_has_the_same_line(tmp_path: Path) -> None:
    page = Path(__file__).parents[2] / "docs" / "formats.md"
    assert f'blender -b --python-expr "{expression(tmp_path)}"' in page.read_text("utf-8")


def test_the_line_makes_a_glb_that_can_be_read(tmp_path: Path) -> None:
    python = os.environ.get("CIRCPARAM_BPY")
    python = python or (sys.executable if importlib.util.find_spec("bpy") else None)
    if python is None:
        pytest.skip("no Blender: name a Python with bpy in CIRCPARAM_BPY")
    line = expression(tmp_path)
    made = "import bpy; bpy.ops.export_scene.fbx(filepath='mesh.fbx')"  # the cube of a new file
    for code in (made, line):
        subprocess.run([python, "-c", code], cwd=tmp_path, check=True, capture_output=True)
    assert len(read(tmp_path / "mesh.glb").mesh.faces) == 12
