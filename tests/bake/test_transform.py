"""Textures that KHR_texture_transform moves: read, baked and shown where the extension puts them."""

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from circparam.bake.bake import bake_document
from circparam.formats.document import Document
from circparam.formats.io import read_data
from circparam.render.show import page_images
from circparam.render.texture import bilinear
from tests.support.formats_tools import GltfMaker, corners, grid

TRANSFORMS: list[dict[str, Any]] = [
    {"offset": [0.25, 0.5]},
    {"scale": [2, 3]},
    {"rotation": np.pi / 2, "offset": [0, 1], "scale": [0.5, 0.5]},
    {"rotation": 0.4, "offset": [0.3, -0.2], "scale": [0.7, 1.6]},
]


def picture() -> Image.Image:
    """Smooth, and without any symmetry; it repeats without a step."""
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(64) + 0.5) / 64)
    waves = [np.sin(2 * np.pi * x), np.cos(2 * np.pi * y), np.sin(2 * np.pi * (x + y))]
    return Image.fromarray(np.round(127 + 120 * np.stack(waves, 2)).astype(np.uint8))


def textured(transforms: list[dict[str, Any]]) -> Document:
    """Grids beside each other, each with the same image and one of the transforms."""
    points, faces = grid(5)
    g = GltfMaker()
    file = io.BytesIO()
    picture().save(file, "PNG")
    g.tree["images"] = [{"bufferView": g.view(file.getvalue()), "mimeType": "image/png"}]
    g.tree["textures"] = [{"source": 0}]
    uv = (points[:, :2] / 5 + 0.1).astype("f4")
    index, places = g.accessor(faces.ravel().astype("u2")), g.accessor(uv)
    g.tree["materials"], primitives = [], []
    for k, transform in enumerate(transforms):
        info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
        g.tree["materials"].append({"pbrMetallicRoughness": {"baseColorTexture": info}})
        position = g.accessor(points + np.float32([6 * k, 0, 0]))
        attributes = {"POSITION": position, "TEXCOORD_0": places}
        primitives.append({"attributes": attributes, "indices": index, "material": k})
    return read_data(g.model(*primitives).glb())


def by_the_extension(transform: dict[str, Any], uv: np.ndarray) -> np.ndarray:
    """The formula of the extension, v downwards in and out."""
    x, y = uv.T * np.reshape(transform.get("scale", [1, 1]), (2, 1))
    t = transform.get("rotation", 0.0)
    turned = np.stack([np.cos(t) * x + np.sin(t) * y, np.cos(t) * y - np.sin(t) * x], 1)
    return turned + transform.get("offset", [0, 0])


def test_every_material_shows_its_own_part_of_one_image() -> None:
    document = textured(TRANSFORMS)
    found = document.textures()
    assert not found.notes
    assert len(set(found.images)) == 1
    plain, placed = corners(document.require_uv()), corners(document.texture_layout(found))
    for k, transform in enumerate(TRANSFORMS):
        part = slice(32 * k, 32 * (k + 1))
        down = plain[part].reshape(-1, 2) * [1, -1] + [0, 1]
        wanted = by_the_extension(transform, down) * [1, -1] + [0, 1]
        np.testing.assert_allclose(placed[part].reshape(-1, 2), wanted, atol=1e-9)


@pytest.mark.parametrize("transform", TRANSFORMS)
def test_colours_come_from_where_the_transform_points(transform: dict[str, Any]) -> None:
    """Baked, and in a page: the colour of the middle of each face is that of the image at the moved uv."""
    document = textured([transform])
    layout = document.require_uv()
    middle = corners(layout).mean(1)
    down = by_the_extension(transform, middle * [1, -1] + [0, 1])
    wanted = bilinear(np.asarray(picture(), float), down * [1, -1] + [0, 1])
    again = bake_document(document, "texture", source=document, size=256)
    baked = bilinear(again.tiles[0, 0][..., :3].astype(float), middle)
    assert np.abs(baked - wanted).max() < 8
    shown, _, notes = page_images(document, 0)
    assert not notes
    page = Image.open(io.BytesIO(shown.files[0][0])).convert("RGB")
    assert np.abs(bilinear(np.asarray(page, float), middle) - wanted).max() < 16
