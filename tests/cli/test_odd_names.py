"""map, morph and bake in the hands of somebody careless: odd names, folders as files, damaged maps."""

import os
from pathlib import Path

import pytest

from tests.support.command_line import one_line_error, report, run
from tests.support.maps import written_belts

NAMES = ("sp ace ü 数", "'quoted' #1 %20", os.fsdecode(b"odd\xff"))


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


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_any_name_will_do(name: str, tmp_path: Path) -> None:
    folder = tmp_path / name
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("the file system has no such names")
    for words in commands(written(folder, f" {name}")).values():
        output = report(*words)["output"]
        assert Path(output[0] if isinstance(output, list) else output).stat().st_size > 100


def test_folders_are_no_files(tmp_path: Path) -> None:
    """An input that is a folder is an error of the input, an output that is one of the output."""
    names = written(tmp_path)
    before = sorted(os.listdir(tmp_path))
    for command, words in commands(names).items():
        for key, path in names.items():
            if path not in words:
                continue
            here = tmp_path / f"folder{path.suffix}"
            here.mkdir()
            output = key in ("out", "png") or (command, key) == ("map", "m")
            result = run(*(here if w == path else w for w in words), "--overwrite")
            one_line_error(result, 8 if output else 3)
            here.rmdir()
    assert sorted(os.listdir(tmp_path)) == before
