"""What a page takes along of a file: its textures, small enough."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.formats.document import Document
from circparam.mesh.mesh import Mesh, UVMap
from circparam.render.show import LARGEST_SIDE_TEXELS, page_images
from tests.support.baking import sheet, stored


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
