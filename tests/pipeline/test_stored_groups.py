"""Atlases that share the plane: the file says which, and check, view and pack know it."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import circparam
from circparam.formats.document import Document
from circparam.formats.io import read, read_data
from circparam.pipeline.inspect import inspect
from circparam.pipeline.unwrap import repack
from circparam.render.show import view_document
from tests.support.formats_tools import GltfMaker, grid

QUICK = {"effort": 0.05, "resolution": 256, "padding": 2}


def two_materials(images: bool = False) -> bytes:
    """A grid of two primitives, each with a material of its own; their uv cover the same square."""
    points, faces = grid(6)
    g = GltfMaker()
    uv = (points[:, :2] / 5).astype("f4")
    attributes = {"POSITION": g.accessor(points), "TEXCOORD_0": g.accessor(uv)}
    other = {"POSITION": g.accessor(points + np.float32([9, 0, 0])), "TEXCOORD_0": 1}
    index = g.accessor(faces.ravel().astype("u2"))
    primitives = [
        {"attributes": a, "indices": index, "material": k}
        for k, a in enumerate((attributes, other))
    ]
    g.tree["materials"] = [{"name": "a"}, {"name": "b"}]
    if images:
        for k, material in enumerate(g.tree["materials"]):
            file = io.BytesIO()
            Image.new("RGB", (2, 2), ("red", "blue")[k]).save(file, "PNG")
            entry = {"bufferView": g.view(file.getvalue()), "mimeType": "image/png"}
            g.tree.setdefault("images", []).append(entry)
            g.tree.setdefault("textures", []).append({"source": k})
            material["pbrMetallicRoughness"] = {"baseColorTexture": {"index": k}}
    return g.model(*primitives).glb()


def overlaps(document: Document, **options: str) -> int:
    found = inspect(document, uv_set=0, resolution=256, **options).uv
    return found.overlap


OBJ = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 3 0 0\nv 4 0 0\nv 4 1 0\nv 3 1 0
usemtl a\nf 1 2 3 4\nusemtl b\nf 5 6 7 8\n"""


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "glb from obj", "obj from glb"])
def test_what_has_an_atlas_of_its_own_stands_in_the_file(tmp_path: Path, suffix: str) -> None:
    """Unwrap, check and pack agree on the file, which says what they do; another unwrap takes it back."""
    end, _, start = suffix.partition(" from ")
    source = tmp_path / f"in.{(start or end).replace('gltf', 'glb')}"
    source.write_bytes(OBJ.encode() if source.suffix == ".obj" else two_materials())
    out = tmp_path / f"out.{end}"
    made = circparam.unwrap(source, out, group_by="primitive", **QUICK)
    assert made.measures["overlap"] == 0
    document = read(out)
    assert document.group_by() == "primitive"
    found = inspect(document, uv_set=0, resolution=256, padding=2)
    assert found.uv.overlap == 0
    assert not found.faults
    assert any("each primitive has an atlas" in note for note in found.notes)
    assert found.uv.numbers()["pack"] == made.measures["pack"]
    assert overlaps(document, group_by="scene") > 0
    packed = repack(out, tmp_path / f"packed.{end}", resolution=256, padding=2)
    assert packed.measures["overlap"] == 0
    assert packed.measures["pages"] == 2
    again = read(tmp_path / f"packed.{end}")
    assert overlaps(again) == 0
    circparam.unwrap(again, tmp_path / f"one.{end}", overwrite_uv=None, **QUICK)
    whole = read(tmp_path / f"one.{end}")
    assert whole.group_by() is None
    assert b"group_by" not in (tmp_path / f"one.{end}").read_bytes()
    assert overlaps(whole) == 0


def test_textures_tell_atlases_apart_where_charts_overlap() -> None:
    """Two images on one square are two atlases; one image, or none, is one."""
    assert overlaps(read_data(two_materials(images=True))) == 0
    assert overlaps(read_data(two_materials(images=True)), group_by="scene") == 1
    assert overlaps(read_data(two_materials())) == 1
    assert overlaps(read_data(two_materials()), group_by="primitive") == 0


def test_a_view_lays_atlases_side_by_side(tmp_path: Path) -> None:
    path = tmp_path / "in.glb"
    path.write_bytes(two_materials(images=True))
    scene = view_document(read(path), tmp_path / "view.svg")
    assert scene.uv[:, 0].max() > 1.5
    one = view_document(read(path), tmp_path / "one.svg", group_by="scene")
    assert one.uv[:, 0].max() <= 1
