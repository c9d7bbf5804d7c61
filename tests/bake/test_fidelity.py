"""Textures of real meshes after the way into a new layout of the same density."""

import os
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.bake import bake_document
from circparam.bake.sampling import texel_ratio, texture_paint
from circparam.formats.io import read
from circparam.formats.materials import decode
from circparam.render.texture import bilinear
from tests.support.formats_tools import corpus_files

WHOLE = bool(os.environ.get("CIRCPARAM_WHOLE_CORPUS"))
TEXTURED = ("fuze.obj", None, *(("CesiumMan.glb", "CesiumMilkTruck.glb") if WHOLE else ()))


@pytest.mark.parametrize("path", [p for p in corpus_files(".obj", ".glb") if p.id in TEXTURED])
def test_a_picture_keeps_40_db_at_equal_density(path: Path, tmp_path: Path) -> None:
    """Between the old and the new texture, at random places of the surface."""
    source = read(path)
    textures = source.textures()
    old = source.texture_layout(textures)
    number = 1 if source.format == "glb" else 0
    out = tmp_path / f"o{path.suffix}"
    circparam.unwrap(source, out, uv_set=number or None, jobs=1, effort=0.05)
    new = read(out).uv(number)
    side = np.mean(
        [max(decode(*p).size) for p in zip(textures.images, textures.names, strict=True)]
    )
    size = round(texel_ratio(old, float(side), new, 1))
    baked = bake_document(read(out), "texture", uv_set=number, source=source, size=size)
    rng = np.random.default_rng(0)
    corners = source.mesh.points[source.mesh.faces]
    areas = np.linalg.norm(np.cross(*(corners[:, k] - corners[:, 0] for k in (1, 2))), axis=1)
    face = rng.choice(len(areas), 200_000, p=areas / areas.sum())
    face = face[textures.face[face] >= 0]
    bary = rng.dirichlet([1, 1, 1], len(face))
    wanted = texture_paint(textures, old)[0](face, bary)[:, :3]
    uv = np.einsum("pk,pkc->pc", bary, new.uv[new.uv_faces[face]])
    error = bilinear(baked.tiles[0, 0][..., :3] / 255, uv) - wanted
    assert -10 * np.log10((error**2).mean()) >= 40
