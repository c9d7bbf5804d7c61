"""Where outputs go, and what is refused before any work begins."""

from pathlib import Path
from typing import Any

import pytest

from circparam.cli.paths import made_folder, output_path, without_outputs
from circparam.errors import OutputError

NOTHING = {"output": None, "out_dir": None, "as_json": False, "format": None, "overwrite": False}


@pytest.mark.parametrize(
    ("mesh", "given", "path"),
    [
        ("a/m.obj", {}, "a/m_uv.obj"),
        ("a/m.PLY", {}, "a/m_uv.PLY"),
        ("m.stl", {}, "m_uv.glb"),  # has no place for uv
        ("m.off", {"out_dir": "out"}, "out/m.glb"),
        ("m.stla", {}, "m_uv.glb"),  # every suffix of such a format
        ("m.STLB", {}, "m_uv.glb"),
        ("m.coff", {}, "m_uv.glb"),
        ("m.vrm", {}, "m_uv.vrm"),
        ("m.txt", {}, "m_uv.txt"),
        (".", {}, "_uv"),  # a directory: reading says so
        ("/", {"out_dir": "out"}, "out"),
        ("a/m.gltf", {"out_dir": "out"}, "out/m.gltf"),
        ("m.obj", {"output": "x.ply"}, "x.ply"),
        ("m.stl", {"format": "obj"}, "m_uv.obj"),
        ("a/m.obj", {"format": "glb", "out_dir": "out"}, "out/m.glb"),
        ("m.obj", {"format": "glb", "output": "x.ply"}, "x.ply"),
        ("-", {}, "-"),
        ("-", {"output": "x.ply"}, "x.ply"),
    ],
)
def test_output_path(mesh: str, given: dict[str, Any], path: str) -> None:
    assert Path(output_path(mesh, NOTHING | given)) == Path(path)


def test_outputs_of_an_earlier_call_are_no_inputs() -> None:
    """What a pattern such as *.obj finds in a folder that was worked on before."""
    names = ("a.obj", "./a_uv.obj", "b_uv.obj", "./c.stl", "c_uv.glb", "-")
    kept, again = ["a.obj", "b_uv.obj", "./c.stl", "-"], ["./a_uv.obj", "c_uv.glb"]
    assert without_outputs(names) == (kept, again)
    assert without_outputs(("a_uv.obj",)) == (["a_uv.obj"], [])
    assert without_outputs(("a_uv.obj", "a_uv_uv.obj")) == (["a_uv.obj"], ["a_uv_uv.obj"])


def test_a_folder_for_outputs_is_made_and_goes_when_nothing_came(tmp_path: Path) -> None:
    new = tmp_path / "x" / "y"
    with made_folder(str(new)):
        assert new.is_dir()
    assert not (tmp_path / "x").exists()
    with made_folder(str(new)):
        (new / "file").write_text("kept")
    with made_folder(str(new)):  # one that is there stays, empty or not
        (new / "file").unlink()
    assert new.is_dir()
    (tmp_path / "file").write_text("in the way")
    for bad in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(OutputError, match="--out-dir"), made_folder(str(bad)):
            pass
    with pytest.raises(ValueError, match="mine"), made_folder(str(tmp_path / "z")):
        raise ValueError("mine")
    assert not (tmp_path / "z").exists()
