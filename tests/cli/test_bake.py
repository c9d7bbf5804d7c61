"""``circparam bake``: files in, files out, and every reason why there is none."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from circparam.cli import cli
from circparam.formats.io import read
from circparam.maps.surface_map import save_map
from circparam.mesh.mesh import UVMap
from tests.support.baking import charts, picture, sheet, smooth, write_obj
from tests.support.maps import same_map


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
        (("old.obj", "--from", "texture"), 3, "uses uv set 0"),
        (("new.obj", "--from", "texture", "--source", "gone.obj"), 3, "no such file"),
        (("new.obj",), 2, "--from"),
        (("new.obj", "--from", "texture", "--size", "0"), 2, "size"),
        (("new.obj", "--from", "normals"), 2, "--source"),
        (("new.obj", "--from", "texture", "--map", "nearest"), 2, "--source"),
        (("new.obj", "--from", "normals", "--source", "old.obj", "--cage", "0"), 2, "above 0"),
        (("new.obj", "--from", "texture", "--source", "old.obj", "--cage", "1"), 2, "nearest"),
        (("new.obj", "--from", "texture", "--source", "old.obj", "--map", "gone.obj"), 3, "read"),
        (
            ("new.obj", "--from", "texture", "--source", "old.obj", "--map", "old.obj"),
            3,
            "not a map",
        ),
        (("bare.obj", "--from", "normals", "--source", "old.obj"), 3, "circparam unwrap"),
    ],
)
def test_what_is_refused(folder: Path, words: tuple[str, ...], code: int, message: str):
    known = {"new.obj", "old.obj", "gone.obj", "bare.obj"}
    (folder / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
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


def test_shape_of_another_mesh_with_its_figures(folder: Path):
    out = folder / "n.png"
    words = ("--source", folder / "old.obj", "--map", "nearest", "--size", 32, "--json", "-o")
    result = run(folder / "new.obj", "--from", "normals", *words, out)
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout)
    assert report["cage"] == pytest.approx(0.02 * np.sqrt(2))
    assert (report["map"], report["missed"], report["empty"]) == ("nearest", 0.0, 0.0)
    assert (np.asarray(Image.open(out)) == [128, 128, 255]).all()
    result = run(folder / "new.obj", "--from", "height", *words, folder / "h.png")
    assert json.loads(result.stdout)["height_range"] == [-report["cage"], report["cage"]]
    assert np.asarray(Image.open(folder / "h.png")).std() == 0
    result = run(folder / "new.obj", "--from", "height", *words, folder / "h.glb")
    assert result.exit_code == 2
    assert ".png" in result.stderr
    assert not (folder / "h.glb").exists()


def test_colours_are_vertex_colours_and_maps_are_read(folder: Path):
    save_map(folder / "m.npz", same_map(read(folder / "new.obj").mesh))
    images = []
    for extra in ((), ("--source", folder / "colours.obj", "--map", folder / "m.npz")):
        out = folder / f"{len(extra)}.png"
        mesh_file = folder / ("new.obj" if extra else "colours.obj")
        result = run(mesh_file, "--from", "colours", *extra, "--size", 64, "-o", out)
        assert result.exit_code == 0, result.stderr
        images.append(np.asarray(Image.open(out)).astype(int))
    assert np.abs(images[0] - images[1]).max() <= 1
