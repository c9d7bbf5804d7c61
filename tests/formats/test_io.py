"""Reading and writing by name: formats told, whole files or none, standard streams."""

import contextlib
import importlib.util
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from circparam.core import files
from circparam.errors import InputError, OptionError, OutputError
from circparam.formats.io import format_of, read, stored, write
from tests.support.format_contract import document
from tests.support.formats_tools import corners, layout_with_seams, smooth_layout


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_error_leaves_nothing_behind(tmp_path, monkeypatch, error):
    doc = document()
    target = tmp_path / "x.gltf"
    write(target, doc, smooth_layout(doc))
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    calls = []

    def sync(handle: int) -> None:
        calls.append(handle)
        if len(calls) == 2:  # the first of two files is written by then
            raise error

    monkeypatch.setattr(files.os, "fsync", sync)
    with pytest.raises(OutputError if isinstance(error, OSError) else KeyboardInterrupt):
        write(target, doc, layout_with_seams(doc), overwrite=True)
    assert len(calls) >= 2
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before
    assert files.TEMPORARIES == []


def test_links_are_written_through(tmp_path: Path) -> None:
    doc = document()
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "x.obj").write_bytes(b"")
    (tmp_path / "x.obj").symlink_to(tmp_path / "real" / "x.obj")
    write(tmp_path / "x.obj", doc, smooth_layout(doc), overwrite=True)
    assert (tmp_path / "x.obj").is_symlink()
    assert (tmp_path / "real" / "x.obj").stat().st_size > 0


def test_standard_streams(monkeypatch: pytest.MonkeyPatch) -> None:
    doc = document()
    uvmap = layout_with_seams(doc)
    for format in ("obj", "ply", "glb", "gltf"):
        pipe = io.TextIOWrapper(io.BytesIO())
        with contextlib.redirect_stdout(pipe):
            written = write("-", doc, uvmap, format=format)
        assert written.path is None
        data = pipe.buffer.getvalue()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        again = read("-", format=format)
        got = again.uv()
        np.testing.assert_array_equal(corners(got), corners(stored(uvmap, format)))
        assert again.path is None


@pytest.mark.parametrize(
    ("name", "cure"),
    [("a.fbx", "Blender makes a GLB"), ("a.ABC", "export a .glb"), ("a.blend", "export a .glb"),
     ("a.iges", "export an .stl or .obj"), ("a.mtl", "give the .obj"), ("a.zip", "unpack")],
)  # fmt: skip
def test_formats_of_other_programs_are_told_what_to_export(tmp_path, name, cure):
    (tmp_path / name).write_bytes(b"\x00\x01 nothing that is known \xff" * 9)
    with pytest.raises(InputError, match=cure) as caught:
        read(tmp_path / name)
    assert str(caught.value).count(name) == 1
    assert "\n" not in str(caught.value)


def test_a_mesh_under_a_foreign_name_is_read_by_its_content(tmp_path: Path) -> None:
    (tmp_path / "a.fbx").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert len(read(tmp_path / "a.fbx").mesh.faces) == 1
    with pytest.raises(OptionError, match=r"end it in \.obj"):
        format_of("out.fbx")


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
