"""``circparam bake``: files in, files out, and every reason why there is none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from circparam.cli import cli
from circparam.formats.io import read
from circparam.mesh.mesh import UVMap
from tests.support.baking import charts, picture, sheet, smooth, write_obj


def run(*words: object) -> Result:
    return CliRunner().invoke(cli, ["bake", *map(str, words)])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    points, faces = sheet(6)
    write_obj(
        tmp_path / "colours.obj", points, charts(points, faces), faces, colours=smooth(points)
    )
    picture(tmp_path / "skin.png", 32)
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd skin.png\n")
    write_obj(tmp_path / "old.obj", points, UVMap(points[:, :2].copy(), faces), faces, mtl="m.mtl")
    write_obj(tmp_path / "new.obj", points, charts(points, faces), faces)
    return tmp_path


def test_vertex_colours_into_a_png(folder: Path):
    out = folder / "out.png"
    result = run(folder / "colours.obj", "--from", "vertex-colors", "--size", 64, "-o", out)
    assert result.exit_code == 0, result.stderr
    assert result.stdout.strip() == str(out)
    image = np.asarray(Image.open(out))
    assert image.shape == (64, 64, 3)
    assert image.std() > 20


def test_texture_of_the_old_file_into_a_glb(folder: Path):
    out = folder / "out.glb"
    words = (folder / "new.obj", "--from", "texture", "--source", folder / "old.obj", "--size", 64)
    result = run(*words, "-o", out, "--json")
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout)
    assert report["output"] == [str(out)]
    assert 0.3 < report["covered"] < 0.9
    document = read(out)
    assert "textures" in document.features
    assert len(document.mesh.faces) == 72
    again = run(*words, "-o", out)
    assert again.exit_code == 2
    assert "--overwrite" in again.stderr
    before = out.read_bytes()
    assert run(*words, "-o", out, "--overwrite", "-q").stdout == ""
    assert out.read_bytes() == before  # the same bytes in every run


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("new.obj", "--from", "vertex-colors"), 3, "no vertex colours"),
        (("new.obj", "--from", "texture"), 3, "--source"),
        (("old.obj", "--from", "texture"), 3, "belongs to uv set 0"),
        (("new.obj", "--from", "texture", "--source", "gone.obj"), 3, "no such file"),
        (("new.obj",), 2, "--from"),
        (("new.obj", "--from", "texture", "--size", "0"), 2, "size"),
    ],
)
def test_what_is_refused(folder: Path, words: tuple[str, ...], code: int, message: str):
    known = {"new.obj", "old.obj", "gone.obj"}
    out = folder / "out.png"
    result = run(*(folder / w if w in known else w for w in words), "-o", out)
    assert result.exit_code == code
    assert message in result.stderr
    assert not out.exists()


def test_a_target_that_is_neither(folder: Path):
    result = run(folder / "colours.obj", "--from", "vertex-colors", "-o", folder / "out.jpg")
    assert result.exit_code == 2
    assert ".png" in result.stderr


def test_a_missing_texture_names_the_file(folder: Path):
    (folder / "skin.png").unlink()
    words = ("--from", "texture", "--source", folder / "old.obj", "-o", folder / "out.png")
    result = run(folder / "new.obj", *words)
    assert result.exit_code == 3
    assert "skin.png is missing" in result.stderr
