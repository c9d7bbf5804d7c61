"""Primitives whose materials became one are one primitive, with every vertex, target and index of before."""

from pathlib import Path
from typing import Any

import numpy as np

import circparam
from circparam.formats.io import read
from tests.support.gltf_files import unused_entries
from tests.support.looks import Painted, psnr, seen, sheet, surface_points, waves
from tests.support.validator import validate

POINTS, FACES, NORMAL, UV = sheet(5)


def pool(g: Painted, k: int) -> dict[str, Any]:
    """Attributes and a morph target of a sheet beside the others."""
    p = POINTS + np.float32([1.3 * k, 0, 0])
    attributes = {
        "POSITION": g.accessor(p, min=p.min(0).tolist(), max=p.max(0).tolist()),
        "NORMAL": g.accessor(NORMAL),
        "TEXCOORD_0": g.accessor(UV),
    }
    lift = np.float32([0, 0, 0.1 + k]) * np.ones_like(p)
    return {"attributes": attributes, "targets": [{"POSITION": g.accessor(lift)}]}


def written(tmp_path: Path) -> Path:
    """One mesh that two nodes show, with primitives of materials 0, 2, 1, 2, 0, 1.

    The first two share their vertices, and the last two; the third has bytes as indices; material 2 is seen
    from both sides, so that it stays.
    """
    g = Painted()
    looks = [
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": g.texture(waves(k, 16))}}}
        for k in range(3)
    ]
    looks[2]["doubleSided"] = True
    first, third, last = pool(g, 0), pool(g, 1), pool(g, 2)
    half = len(FACES) // 2
    rows = [
        (first, FACES[:half], 0, "u2"), (first, FACES[half:], 2, "u2"), (third, FACES, 1, "u1"),
        (pool(g, 3), FACES, 2, "u2"), (last, FACES[half:], 0, "u2"), (last, FACES[:half], 1, "u2"),
    ]  # fmt: skip
    primitives = [
        {**own, "indices": g.accessor(f.ravel().astype(kind)), "material": k, "extras": {"a": 1}}
        for own, f, k, kind in rows
    ]
    g.tree |= {"materials": looks, "meshes": [{"primitives": primitives, "weights": [0.0]}]}
    g.scene({"mesh": 0}, {"mesh": 0, "translation": [0, 3, 0]})
    path = tmp_path / "old.glb"
    path.write_bytes(g.glb())
    return path


def test_primitives_of_one_material_are_joined_without_loss(tmp_path: Path) -> None:
    old_path, new_path = written(tmp_path), tmp_path / "new.glb"
    result, look = circparam.rebake(
        old_path, new_path, size=256, jobs=1, effort="draft", pack_splits=0
    )
    assert look.draw_calls == (12, 8)
    old, new = read(old_path), read(new_path)
    # the first sheet is shown by a material that stays as well, so it keeps its vertices
    entries = new.tree.json["meshes"][0]["primitives"]
    assert [e.get("material") for e in entries] == [0, 1, 0, 1]
    assert all(e["extras"] == {"a": 1} for e in entries)
    face, vertex = result.face_map, result.vertex_map
    np.testing.assert_array_equal(np.sort(face), np.arange(len(old.mesh.faces)))
    np.testing.assert_array_equal(vertex[new.mesh.faces], old.mesh.faces[face])
    np.testing.assert_array_equal(new.mesh.points, old.mesh.points[vertex])
    (_, before), (_, after) = old.targets()[0], new.targets()[0]
    np.testing.assert_array_equal(after, before[vertex])
    normals = old.normals()
    np.testing.assert_array_equal(new.normals(), normals[face])
    at, bary = surface_points(new, 3000)
    a, b = seen(old, face[at], bary), seen(new, at, bary)
    assert psnr(a["base"], b["base"]) >= 40
    assert unused_entries(new.tree.json) == (set(), set())
    sizes = [view["byteLength"] for view in new.tree.json["bufferViews"]]
    assert 0 <= len(new.tree.bin or b"") - sum(sizes) < 4 * len(sizes), "no bytes without a view"
    said = validate(old_path, new_path)
    assert said[1] <= said[0]


def test_primitives_stay_where_materials_do(tmp_path: Path) -> None:
    _, look = circparam.rebake(
        written(tmp_path), tmp_path / "new.glb", size=64, padding=1, merge_materials="none",
        jobs=1, effort="draft",
    )  # fmt: skip
    assert look.draw_calls == (12, 12)
