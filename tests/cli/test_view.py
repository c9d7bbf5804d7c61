"""``circparam view``: every kind of picture from a file (tests/cli/test_refusals.py: why there is none)."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from PIL import Image

from circparam import samples
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.reading import Tree
from circparam.formats.io import read
from circparam.formats.source import Source
from circparam.maps.morph import morph
from tests.support.baking import write_obj
from tests.support.bumps import belt
from tests.support.command_line import done, run
from tests.support.maps import same_map

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
UV = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACES = "f 1/1 2/2 3/3 4/4\n"


@pytest.fixture
def quad(tmp_path: Path) -> Path:
    path = tmp_path / "quad.obj"
    path.write_text(QUAD + UV + FACES)
    return path


def page_of(mesh: Path, *words: object) -> str:
    """The text of a page, whose making went well."""
    out = mesh.parent / "page.html"
    result = done("view", mesh, "-o", out, *words)
    assert "outside" not in result.stderr  # uv that repeat are shown, not complained of
    return out.read_text("utf-8")


def test_each_kind_of_file(quad: Path):
    result = done("view", quad)
    picture = quad.with_name("quad_view.png")
    assert result.stdout.strip() == str(picture)
    assert Image.open(picture).size == (1600, 1010)
    svg = quad.with_suffix(".svg")
    words = ("--format", "obj", "-o", svg, "--up", "z", "--padding", "0.01", "--scale", "3", "-q")
    text = QUAD + UV.replace("vt 1 1", "vt 2.5 1") + FACES  # outside the square, from a pipe
    assert run("view", "-", *words, input=text.encode()).stdout == ""
    assert ET.parse(svg).getroot().tag.endswith("svg")
    assert "chart-0" in svg.read_text()
    page = page_of(quad)
    assert "quad.obj" in page
    assert "this mesh has no texture" in page


def test_a_texture_is_in_the_page(tmp_path: Path):
    for path in samples.files("vase"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    assert "data:image/" in page_of(tmp_path / samples.path("vase").name)


@pytest.mark.parametrize(
    ("image", "said"), [(None, "gone.png is missing"), (b"no image at all", "cannot be read")]
)
def test_a_texture_that_cannot_be_shown_is_a_note_in_the_page(image, said, quad):
    quad.with_name("m.mtl").write_text("newmtl m\nmap_Kd gone.png\n")
    quad.write_text("mtllib m.mtl\nusemtl m\n" + QUAD + UV + FACES)
    if image is not None:
        quad.with_name("gone.png").write_bytes(image)
    page = page_of(quad)
    assert said in page
    assert ("data:image/png" in page) or image is None  # a grey placeholder


def test_before_and_after_are_in_one_page(quad: Path, tmp_path: Path):
    old = tmp_path / "old.obj"
    old.write_text(QUAD + UV.replace("vt 1 1", "vt 0.5 0.5") + FACES)
    page = page_of(quad, "--before", old)
    assert page.count('class="layout"') == 2
    assert page.count('"The surface of ') == page.count('"The uv layout of ') == 2
    assert ">before</h2>" in page
    assert ">after</h2>" in page


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
    page = page_of(tmp_path / "m.glb")
    assert page.count('type="range" id="morph-') == 8
    for words in ("smile", "target 8", "the first 8 of 9 morph targets have a slider"):
        assert words in page
