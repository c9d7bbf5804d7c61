"""Colours carried into a layout: known surfaces, what comes back, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.bake.bake import bake, bake_document
from circparam.bake.sampling import corner_paint
from circparam.core.arrays import FloatArray
from circparam.errors import InputError
from circparam.formats.io import read
from circparam.mesh.mesh import UVMap
from circparam.render.texture import bilinear
from tests.support.baking import (
    back,
    charts,
    sample_back,
    sheet,
    smooth,
    some_places,
    write_obj,
)


def test_vertex_colours_come_back():
    points, faces = sheet(12)
    layout = charts(points, faces)
    colours = smooth(points)
    baked = bake(layout, corner_paint(colours[faces]), 256)
    face, bary = some_places(len(faces))
    truth = np.einsum("pk,pkc->pc", bary, colours[faces[face]])
    error = np.abs(sample_back(baked, layout, face, bary) - truth)
    assert error.mean() < 1 / 255
    assert error.max() < 8 / 255  # at the borders too: the colours reach into the padding


def test_tiles_become_images_of_their_own():
    points, faces = sheet(2)
    uv = np.concatenate([points[:, :2] * 0.9 + 0.05, points[:, :2] * 0.9 + [1.05, 0.05]])
    layout = UVMap(uv, np.concatenate([faces, faces + len(points)]))
    red, blue = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    corners = np.concatenate([np.tile(red, (len(faces), 3, 1)), np.tile(blue, (len(faces), 3, 1))])
    baked = bake(layout, corner_paint(corners), 8)
    assert sorted(baked.tiles) == [(0, 0), (1, 0)]
    assert (baked.tiles[0, 0] == [255, 0, 0]).all()
    assert (baked.tiles[1, 0] == [0, 0, 255]).all()


@pytest.mark.parametrize(
    ("uv", "message"),
    [
        (np.array([[0.0, 0], [1.5, 0], [0, 1.0]]), "unit tile"),
        (np.array([[-0.2, 0], [0.5, 0], [0, 1.0]]), "unit tile"),
        (np.array([[np.nan, 0], [1.0, 0], [0, 1.0]]), "NaN"),
        (np.array([[0.0, 0], [1e-9, 0], [0, 1e-9]]), "too small"),
    ],
)
def test_layouts_that_hold_no_image(uv: FloatArray, message: str):
    layout = UVMap(uv, np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match=message):
        bake(layout, corner_paint(np.ones((1, 3, 3))), 16)


def test_overlapping_faces_are_told():
    uv = np.array([[0.0, 0], [1, 0], [0, 1.0]])
    layout = UVMap(uv, np.array([[0, 1, 2], [0, 1, 2]]))
    baked = bake(layout, corner_paint(np.ones((2, 3, 3))), 32)
    assert any("several faces" in note for note in baked.notes)


def test_texture_of_another_mesh(files: Path):
    points, faces = sheet(7)  # the same place in space, other triangles
    write_obj(files / "other.obj", points, UVMap(points[:, :2].copy(), faces), faces, mtl="m.mtl")
    baked = bake_document(
        read(files / "new.obj"), "texture", source=read(files / "other.obj"), size=256
    )
    assert back(baked, files) < 2 / 255
    assert any("closest" in note for note in baked.notes)


@pytest.mark.parametrize(
    ("scale", "shift", "told"),
    [
        (1.0, 0.01, None),
        (1.0, 0.5, "% of its size away"),
        (1000.0, 300.0, "refused"),
        (1.0, 5.0, "refused"),
    ],
)
def test_sources_in_another_place_or_scale_are_told(files, scale, shift, told):
    """A source in millimetres gave the colour of one point, without a word."""
    points, faces = sheet(7)
    layout = UVMap(points[:, :2].copy(), faces)
    write_obj(files / "other.obj", points * scale + [0, 0, shift], layout, faces, mtl="m.mtl")
    new, other = read(files / "new.obj"), read(files / "other.obj")
    if told == "refused":
        with pytest.raises(InputError, match=r"new.obj: it lies .* its size away from .*other.obj"):
            bake_document(new, "texture", source=other, size=16)
        return
    notes = bake_document(new, "texture", source=other, size=16).notes
    assert any("of its size away" in note for note in notes) == (told is not None)


def test_a_large_texture_is_averaged_not_skipped(files: Path):
    noise = np.random.default_rng(0).integers(0, 256, (1024, 1024, 3), dtype=np.uint8)
    Image.fromarray(noise).save(files / "skin.png")
    baked = bake_document(
        read(files / "new.obj"), "texture", source=read(files / "old.obj"), size=64
    )
    # one texel of 64 covers hundreds of the source: their mean is grey, a single one is noise
    assert np.std(baked.tiles[0, 0].astype(float)) < 20


def test_alpha_is_kept_and_plain_materials_are_opaque(files: Path):
    """A texture with alpha on half of the faces, a plain red material on the others."""
    n = 128
    u = np.broadcast_to((np.arange(n) + 0.5) / n, (n, n))
    rgba = np.stack([np.full((n, n), 0.2), u, 1 - u, 0.3 + 0.5 * u], 2)
    Image.fromarray(np.round(rgba * 255).astype(np.uint8)).save(files / "skin.png")
    (files / "m.mtl").write_text("newmtl m\nmap_Kd skin.png\nnewmtl red\nKd 1 0 0\n")
    lines = (files / "old.obj").read_text().splitlines()
    faces = [k for k, line in enumerate(lines) if line.startswith("f ")]
    half = len(faces) // 2
    lines.insert(faces[half], "usemtl red")
    (files / "old.obj").write_text("\n".join(lines) + "\n")
    new, old = read(files / "new.obj"), read(files / "old.obj")
    baked = bake_document(new, "texture", source=old, size=256)
    layout, before = new.uv(), old.uv()
    face, bary = some_places(len(faces))
    seen = sample_back(baked, layout, face, bary)
    inside = bary.min(1) > 0.25  # farther than a texel from faces of the other material
    red = inside & (face >= half)
    np.testing.assert_allclose(seen[red], np.tile([1.0, 0, 0, 1], (red.sum(), 1)), atol=1e-9)
    shown = inside & (face < half)
    uv = np.einsum("pk,pkc->pc", bary, before.uv[before.uv_faces[face]])
    assert np.abs(seen - bilinear(rgba, uv))[shown].max() < 3 / 255
