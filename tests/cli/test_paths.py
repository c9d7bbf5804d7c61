"""Where outputs go, and what is refused before any work begins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from circparam.cli.paths import check_outputs, output_path
from circparam.errors import OptionError

NOTHING = {
    "output": None,
    "out_dir": None,
    "as_json": False,
    "format": None,
    "overwrite": False,
}


@pytest.mark.parametrize(
    ("mesh", "given", "path"),
    [
        ("a/m.obj", {}, "a/m_uv.obj"),
        ("a/m.PLY", {}, "a/m_uv.PLY"),
        ("m.stl", {}, "m_uv.glb"),  # has no place for uv
        ("m.off", {"out_dir": "out"}, "out/m.glb"),
        ("a/m.gltf", {"out_dir": "out"}, "out/m.gltf"),
        ("m.obj", {"output": "x.ply"}, "x.ply"),
        ("-", {}, "-"),
        ("-", {"output": "x.ply"}, "x.ply"),
    ],
)
def test_output_path(mesh: str, given: dict[str, Any], path: str) -> None:
    assert Path(output_path(mesh, NOTHING | given)) == Path(path)


REFUSED = {
    "both": ("a", "o", {"output": "o", "out_dir": "d"}, "exclude each other"),
    "one file for two": ("a b", "o o", {"output": "o"}, "2 meshes"),
    "one map for two": ("a b", "x y", {"index_map": "m.npz"}, "--map names one file"),
    "one preview for two": ("a b", "x y", {"preview": "p.png"}, "--preview names one file"),
    "stdout twice": ("-", "-", {"as_json": True, "format": "obj"}, "stdout"),
    "two meshes to stdout": ("a b", "- -", {}, "stdout"),
    "two of one name": ("a b", "o o", {}, "one by one"),
    "format of no stream": ("a", "o", {"format": "obj"}, "--format has no effect"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str) -> None:
    meshes, outputs, given, word = REFUSED[name]
    with pytest.raises(OptionError, match=word):
        check_outputs(tuple(meshes.split()), outputs.split(), NOTHING | given)


def test_what_is_fine() -> None:
    check_outputs(("a", "b"), ["x", "y"], NOTHING | {"out_dir": "d", "as_json": True})
    check_outputs(("-",), ["o"], NOTHING | {"output": "o", "format": "obj", "as_json": True})
    check_outputs(("a",), ["-"], NOTHING | {"output": "-", "format": "obj"})
    check_outputs(("a",), ["o"], NOTHING | {"index_map": "m.npz"})


@pytest.mark.parametrize("extra", [{}, {"index_map": "there"}, {"export_seams": "there"}])
def test_a_file_that_is_there_stays(extra: dict[str, Any], tmp_path: Path) -> None:
    there = tmp_path / "there"
    there.write_text("mine")
    given = NOTHING | {name: str(there) for name in extra}
    out = str(tmp_path / "new") if extra else str(there)
    with pytest.raises(OptionError, match="there exists: give --overwrite"):
        check_outputs(("a",), [out], given)
    check_outputs(("a",), [out], given | {"overwrite": True})
