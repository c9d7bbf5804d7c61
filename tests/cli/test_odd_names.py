"""map, morph and bake in the hands of somebody careless: odd names, folders as files, damaged maps."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from circparam.cli import cli
from circparam.maps.surface_map import save_map
from tests.cli.test_unwrap import one_line_error
from tests.support.baking import write_obj
from tests.support.bumps import belt
from tests.support.maps import known_map

NAMES = ("sp ace ü 数", "'quoted' #1 %20", os.fsdecode(b"odd\xff"))


def run(*words: object) -> Result:
    return CliRunner().invoke(cli, [str(w) for w in words])


@pytest.fixture(params=NAMES, ids=ascii)
def names(request: pytest.FixtureRequest, tmp_path: Path) -> dict[str, Path]:
    """Two meshes with uv and the map between both, in a folder of an odd name, named oddly themselves."""
    folder = tmp_path / request.param
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("the file system has no such names")
    found = {k: folder / f"{k} {request.param}.{end}" for k, end in
             (("a", "obj"), ("b", "obj"), ("m", "npz"), ("out", "glb"), ("png", "png"))}  # fmt: skip
    meshes = []
    for key, size, bump in (("a", 6, 0.0), ("b", 9, 0.05)):
        mesh, layout = belt(size, 2 * size, bump)
        write_obj(found[key], mesh.points, layout, mesh.faces)
        meshes.append(mesh)
    save_map(found["m"], known_map(*meshes))
    return found


def commands(n: dict[str, Path]) -> dict[str, list[object]]:
    return {
        "map": ["map", n["a"], n["b"], "-o", n["m"], "--overwrite"],
        "morph": ["morph", n["a"], n["b"], "--map", n["m"], "-o", n["out"]],
        "bake": [
            *("bake", n["a"], "--from", "normals", "--source", n["b"], "--size", 32),
            *("--map", n["m"], "-o", n["png"]),
        ],
    }


@pytest.mark.parametrize("command", ["map", "morph", "bake"])
def test_any_name_will_do(names: dict[str, Path], command: str) -> None:
    words = commands(names)[command]
    result = run(*words, "--json")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    output = report["output"]
    assert Path(output[0] if isinstance(output, list) else output).stat().st_size > 100


@pytest.mark.parametrize("command", ["map", "morph", "bake"])
def test_folders_are_no_files(names: dict[str, Path], command: str) -> None:
    """An input that is a folder is an error of the input, an output that is one of the output."""
    words = commands(names)[command]
    before = sorted(os.listdir(names["a"].parent))
    for key, code in (("a", 3), ("b", 3), ("m", 3), ("out", 8), ("png", 8)):
        if names[key] not in words:
            continue
        path = names[key]
        if command == "map" and key == "m":
            code = 8
        here = names["a"].parent / f"folder{path.suffix}"
        here.mkdir()
        result = run(*(here if w == path else w for w in words), "--overwrite")
        one_line_error(result, code)
        here.rmdir()
    assert sorted(os.listdir(names["a"].parent)) == before


@pytest.mark.parametrize("command", ["morph", "bake"])
@pytest.mark.parametrize("how", ["shorter", "beyond", "cut off", "none"])
def test_a_damaged_map_is_an_error_of_the_input(tmp_path: Path, command: str, how: str) -> None:
    meshes = []
    for key, size in (("a", 6), ("b", 9)):
        mesh, layout = belt(size, 2 * size, 0.0)
        write_obj(tmp_path / f"{key}.obj", mesh.points, layout, mesh.faces)
        meshes.append(mesh)
    names = {k: tmp_path / f"{k}.obj" for k in "ab"}
    names |= {"m": tmp_path / "m.npz", "out": tmp_path / "o.glb", "png": tmp_path / "o.png"}
    save_map(names["m"], known_map(*meshes))
    with np.load(names["m"]) as file:
        data = dict(file)
    if how == "cut off":
        whole = names["m"].read_bytes()
        names["m"].write_bytes(whole[: len(whole) // 2])
    elif how == "none":
        shutil.copy(names["a"], names["m"])
    else:
        if how == "shorter":
            data |= {"a_face": data["a_face"][:-1], "a_weights": data["a_weights"][:-1]}
        else:
            data["a_face"] += 10**6
        np.savez(names["m"], **data)
    one_line_error(run(*commands(names)[command]), 3, "map")
    assert not names["out"].exists()
    assert not names["png"].exists()
