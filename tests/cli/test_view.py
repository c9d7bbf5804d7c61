"""``circparam view``: every kind of picture from a file, and every reason why there is none."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from circparam import samples
from circparam.cli import cli
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.reading import Tree
from circparam.formats.io import read
from circparam.formats.source import Source
from circparam.maps.morph import morph
from tests.support.baking import write_obj
from tests.support.bumps import belt
from tests.support.maps import same_map

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
UV = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACES = "f 1/1 2/2 3/3 4/4\n"


def run(*words: object, data: bytes | None = None) -> Result:
    return CliRunner().invoke(cli, ["view", *map(str, words)], input=data)


@pytest.fixture
def quad(tmp_path: Path) -> Path:
    path = tmp_path / "quad.obj"
    path.write_text(QUAD + UV + FACES)
    return path


def test_png_stands_beside_the_mesh_and_is_named(quad: Path):
    result = run(quad)
    assert result.exit_code == 0, result.stderr
    picture = quad.with_name("quad_view.png")
    assert result.stdout.strip() == str(picture)
    assert Image.open(picture).size == (1600, 1010)


def test_svg_and_page(quad: Path):
    svg, html = quad.with_suffix(".svg"), quad.with_suffix(".html")
    assert run(quad, "-o", svg).exit_code == 0
    assert ET.parse(svg).getroot().tag.endswith("svg")
    assert run(quad, "-o", html, "-q").stdout == ""
    text = html.read_text("utf-8")
    assert "quad.obj" in text
    assert "this mesh has no texture" in text


def test_a_texture_of_its_own_is_in_the_page(tmp_path: Path):
    out = tmp_path / "vase.html"
    result = run(samples.path("vase"), "-o", out)
    assert result.exit_code == 0, result.stderr
    assert "data:image/" in out.read_text("utf-8")
    assert "outside" not in result.stderr  # uv that repeat are shown, not complained of


def test_a_missing_texture_is_a_note_and_the_page_is_made(quad: Path):
    quad.with_name("m.mtl").write_text("newmtl m\nmap_Kd gone.png\n")
    quad.write_text("mtllib m.mtl\nusemtl m\n" + QUAD + UV + FACES)
    out = quad.with_suffix(".html")
    assert run(quad, "-o", out).exit_code == 0
    assert "gone.png is missing" in out.read_text("utf-8")


def test_a_broken_texture_is_a_grey_placeholder(quad: Path):
    quad.with_name("bad.png").write_bytes(b"no image at all")
    quad.with_name("m.mtl").write_text("newmtl m\nmap_Kd bad.png\n")
    quad.write_text("mtllib m.mtl\nusemtl m\n" + QUAD + UV + FACES)
    out = quad.with_suffix(".html")
    assert run(quad, "-o", out).exit_code == 0
    text = out.read_text("utf-8")
    assert "cannot be read" in text
    assert "data:image/png" in text


def test_a_large_texture_is_scaled_down(quad: Path):
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (400, 3000, 3), dtype=np.uint8)
    Image.fromarray(noise).save(quad.with_name("big.png"))
    quad.with_name("m.mtl").write_text("newmtl m\nmap_Kd big.png\n")
    quad.write_text("mtllib m.mtl\nusemtl m\n" + QUAD + UV + FACES)
    out = quad.with_suffix(".html")
    assert run(quad, "-o", out).exit_code == 0
    assert out.stat().st_size < 1_500_000 < quad.with_name("big.png").stat().st_size


def test_uv_outside_the_square_and_other_options(quad: Path):
    quad.write_text(QUAD + UV.replace("vt 1 1", "vt 2.5 1") + FACES)
    words = ("--up", "z", "--padding", "0.01", "--scale", "3")
    assert run(quad, "-o", quad.with_suffix(".svg"), *words).exit_code == 0


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        (QUAD + "f 1 2 3 4\n", 3, "circparam unwrap"),
        (QUAD + UV.replace("vt 1 1", "vt nan 1") + FACES, 3, "NaN"),
    ],
)
def test_no_uv_and_nan_uv(quad: Path, text: str, code: int, message: str):
    quad.write_text(text)
    out = quad.with_suffix(".png")
    result = run(quad, "-o", out)
    assert result.exit_code == code
    assert message in result.stderr
    assert "quad.obj" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not out.exists()


def test_what_is_refused(quad: Path, tmp_path: Path):
    assert run(quad, "-o", tmp_path / "a.bmp").exit_code == 2
    assert run(quad, "-o", tmp_path / "a").exit_code == 2
    assert run(tmp_path / "no.obj", "-o", tmp_path / "a.png").exit_code == 3
    assert run(quad, "--uv-set", "1").exit_code == 3
    assert run(quad, "--scale", "1").exit_code == 2
    for flag in ("--scale", "--padding"):  # click's ranges let it through
        assert "nan is not a number" in run(quad, flag, "nan").stderr
    assert run("-", data=quad.read_bytes()).exit_code == 2
    assert run(quad, "-o", tmp_path / "no" / "a.svg").exit_code == 8
    mine = tmp_path / "mine.png"
    mine.write_text("mine")
    result = run(quad, "-o", mine)
    assert result.exit_code == 2
    assert "--overwrite" in result.stderr
    assert mine.read_text() == "mine"


def test_before_and_after_are_in_one_page(quad: Path, tmp_path: Path):
    old, out = tmp_path / "old.obj", tmp_path / "both.html"
    old.write_text(QUAD + UV.replace("vt 1 1", "vt 0.5 0.5") + FACES)
    assert run(quad, "--before", old, "-o", out).exit_code == 0
    text = out.read_text("utf-8")
    assert text.count('class="layout"') == 2
    assert ">before</h2>" in text
    assert ">after</h2>" in text


def test_what_is_no_before(quad: Path, tmp_path: Path):
    bare = tmp_path / "bare.obj"
    bare.write_text(QUAD + "f 1 2 3 4\n")
    out = tmp_path / "both.html"
    for words, code, message in (
        ((quad, "--before", quad, "-o", tmp_path / "both.png"), 2, "end the name in .html"),
        ((quad, "--before", bare, "-o", out), 3, "bare.obj"),
        ((quad, "--before", tmp_path / "no.obj", "-o", out), 3, "no.obj"),
        (("-", "--before", "-", "-o", out), 2, "both standard input"),
    ):
        result = run(*words)
        assert result.exit_code == code
        assert message in result.stderr
        assert len(result.stderr.splitlines()) == 1
    assert not out.exists()


def test_from_standard_input(quad: Path):
    out = quad.with_suffix(".svg")
    result = run("-", "--format", "obj", "-o", out, data=quad.read_bytes())
    assert result.exit_code == 0, result.stderr
    assert "chart-0" in out.read_text()


def test_a_slider_for_each_of_the_first_morph_targets(tmp_path: Path):
    """Nine targets of one mesh: eight sliders with their names, and a note on the ninth."""
    mesh, layout = belt(4, 8)
    write_obj(tmp_path / "a.obj", mesh.points, layout, mesh.faces)
    document = read(tmp_path / "a.obj")
    found = Tree(morph(document, document, same_map(mesh)).data, Source("x.glb"))
    (primitive,) = found.json["meshes"][0]["primitives"]
    primitive["targets"] *= 9
    found.json["meshes"][0] |= {"weights": [0] * 9, "extras": {"targetNames": ["smile"]}}
    found.json.pop("animations")
    (tmp_path / "m.glb").write_bytes(glb_bytes(found.json, found.bin))
    result = run(tmp_path / "m.glb", "-o", tmp_path / "m.html")
    assert result.exit_code == 0, result.stderr
    text = (tmp_path / "m.html").read_text("utf-8")
    assert text.count('type="range" id="morph-') == 8
    assert "smile" in text
    assert "target 8" in text
    assert "the first 8 of 9 morph targets have a slider" in text
