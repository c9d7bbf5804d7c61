"""Whole pictures, writing them, and what a page takes along of a file."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

import circparam
from circparam.errors import OutputError
from circparam.formats.document import Document
from circparam.mesh.mesh import Mesh, UVMap
from circparam.render.colours import distortion_map
from circparam.render.figures import PictureOptions
from circparam.render.picture import draw_figure, draw_scale, save_preview, save_result, to_image
from circparam.render.scene import make_scene
from circparam.render.show import LARGEST_SIDE_TEXELS, page_images
from circparam.render.text import fitted, width
from tests.support import shapes
from tests.support.baking import sheet, stored
from tests.support.scenes import IN_SPACE, QUAD, SQUARE, cube


def test_preview_of_every_kind(tmp_path: Path):
    points, faces, uv, uv_faces = cube()
    mesh, uvmap = Mesh(points, faces), UVMap(uv, uv_faces)
    measures = {"flips": 0, "distortion": 1.0432198, "charts": 6, "pack": 0.64, "gap_texels": None}
    look = PictureOptions(title="cube", samples=1)
    for name in ("a.png", "a.svg", "a.html"):
        save_preview(tmp_path / name, mesh, uvmap, measures, look)
        save_preview(tmp_path / f"again-{name}", mesh, uvmap, measures, look)
        first, second = ((tmp_path / n).read_bytes() for n in (name, f"again-{name}"))
        assert first == second  # the same bytes every time
    image = np.asarray(Image.open(tmp_path / "a.png"))
    assert image.shape == (1010, 1600, 3)
    assert len(np.unique(image.astype(int) @ [1, 256, 65536])) > 100
    with pytest.raises(OutputError, match="png"):
        save_preview(tmp_path / "a.bmp", mesh, uvmap, measures)
    with pytest.raises(OutputError, match="does not exist"):
        save_preview(tmp_path / "no" / "a.svg", mesh, uvmap, measures)
    assert sorted(p.name for p in tmp_path.iterdir() if p.name.startswith(".")) == []


def test_the_title_of_a_result_has_as_many_charts_as_its_figures(tmp_path: Path):
    """A triangle without area is no chart in either."""
    points, faces = shapes.grid(3, 3)
    line = np.array([[5.0, 0, 0], [6, 0, 0], [7, 0, 0]])
    faces = np.concatenate([faces, [np.arange(3) + len(points)]])
    result = circparam.unwrap((np.concatenate([points, line]), faces), effort=0)
    save_result(tmp_path / "a.svg", result, "grid")
    assert result.measures["charts"] == 1
    assert "1 chart<" in (tmp_path / "a.svg").read_text()


def test_a_point_sized_and_a_flat_mesh_are_drawn():
    points = np.zeros((3, 3))
    scene = make_scene(points, np.array([[0, 1, 2]]), np.zeros((3, 2)), np.array([[0, 1, 2]]))
    assert draw_figure(scene, PictureOptions(samples=1)).size == (1600, 1010)
    huge = make_scene(1e12 * IN_SPACE, QUAD, SQUARE * 1e-9, QUAD)
    assert np.allclose(huge.distortion, 1)
    assert draw_figure(huge, PictureOptions(samples=1)).size == (1600, 1010)


def test_the_scale_of_distortion_goes_through_the_whole_map():
    page = Image.new("RGB", (600, 40), "white")
    draw = ImageDraw.Draw(page)
    draw_scale(page, draw, 590, 8, 2.0, "1 is perfect")
    left = 590 - int(width(draw, "2 or more", 16)) - 250
    bar = np.asarray(page)[13:25, left : left + 240]
    np.testing.assert_array_equal(bar, np.repeat(to_image(distortion_map(240)[None]), 12, 0))


@pytest.mark.parametrize("room", [60, 100, 180])
def test_a_text_that_is_too_wide_loses_as_little_of_its_middle_as_it_has_to(room: int):
    draw = ImageDraw.Draw(Image.new("RGB", (9, 9)))
    text = "a long name of some mesh.obj"
    assert fitted(draw, text, 16, 1000) == text
    begin, end = fitted(draw, text, 16, room).split("…")
    assert (text.startswith(begin), text.endswith(end)) == (True, True)
    assert 0 <= len(begin) - len(end) <= 1
    assert width(draw, f"{begin}…{end}", 16) <= room
    more = len(begin) + len(end) + 1
    assert width(draw, f"{text[: more - more // 2]}…{text[-(more // 2) :]}", 16) > room


def textured(folder: Path) -> Document:
    """A sheet with skin.png as its texture."""
    (folder / "m.mtl").write_text("newmtl m\nmap_Kd skin.png\n")
    points, faces = sheet(2)
    return stored(folder, "a", Mesh(points, faces), UVMap(points[:, :2], faces), mtl="m.mtl")


@pytest.mark.parametrize(("mode", "kind"), [("RGB", "JPEG"), ("RGBA", "PNG")])
def test_large_textures_are_scaled_down_and_keep_their_alpha(tmp_path: Path, mode: str, kind: str):
    """A wide image, its left half one colour (and half clear), its right half another."""
    left, right = ((200, 40, 60, 128), (20, 180, 90, 255))
    image = Image.new(mode, (2 * LARGEST_SIDE_TEXELS, 64), right[: len(mode)])
    image.paste(left[: len(mode)], (0, 0, LARGEST_SIDE_TEXELS, 64))
    image.save(tmp_path / "skin.png")
    found, why, notes = page_images(textured(tmp_path), 0)
    assert found is not None, why
    assert notes == []
    ((data, media),) = found.files
    assert media == f"image/{kind.lower()}"
    small = Image.open(io.BytesIO(data))
    assert (small.format, small.mode, small.size) == (kind, mode, (LARGEST_SIDE_TEXELS, 32))
    for x, colour in ((100, left), (LARGEST_SIDE_TEXELS - 100, right)):
        seen = np.array(small.getpixel((x, 16)), float)
        assert np.abs(seen - colour[: len(mode)]).max() <= 4


def test_small_textures_go_as_they_are(tmp_path: Path):
    Image.new("RGB", (16, 8), (1, 2, 3)).save(tmp_path / "skin.png")
    document = textured(tmp_path)
    found, _, _ = page_images(document, 0)
    assert found.files == [((tmp_path / "skin.png").read_bytes(), "image/png")]
    assert page_images(document, 1)[:2] == (None, "the texture belongs to uv set 0")
