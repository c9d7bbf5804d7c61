"""glTF: what accessors say is what is read, and only what uv touches changes in the tree."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.formats.document import WriteOptions
from circparam.formats.io import read, read_data
from tests.support.formats_tools import (
    GltfMaker,
    assert_round_trip,
    corpus_files,
    layout_with_seams,
    smooth_layout,
)
from tests.support.gltf_files import assert_same_but_uv, full_mesh, small, unused_entries


@st.composite
def gltf_files(draw: st.DrawFn) -> bytes:
    """Trees with random accessors: types, strides, offsets, sharing, modes."""
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    g = GltfMaker()
    meshes = []
    for _ in range(draw(st.integers(1, 2))):
        primitives = []
        n = draw(st.integers(3, 12))
        points = rng.normal(size=(n, 3)).astype("f4")
        stride = draw(st.sampled_from([0, 12, 16, 20]))
        offset = draw(st.sampled_from([0, 4])) if stride > 12 else 0
        if stride:
            raw = np.zeros((n, stride), "u1")
            raw[:, offset : offset + 12] = points.view("u1").reshape(n, 12)
            position = g.accessor(points, g.view(raw.tobytes(), byteStride=stride), offset)
        else:
            position = g.accessor(points)
        attributes = {"POSITION": position}
        for name in draw(
            st.lists(
                st.sampled_from(["NORMAL", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0", "_ID"]),
                unique=True,
            )
        ):
            kind = {"NORMAL": ("f4", 3), "COLOR_0": ("u2", 4), "_ID": ("f4", 1)}.get(
                name, ("f4", 2)
            )
            array = rng.integers(0, 9, (n, kind[1])).astype(kind[0])
            attributes[name] = g.accessor(array if kind[1] > 1 else array[:, 0])
        for _ in range(draw(st.integers(1, 3))):
            p: dict = {"attributes": dict(attributes), "mode": draw(st.sampled_from([4, 4, 5, 6]))}
            if draw(st.booleans()):
                size = 3 * draw(st.integers(1, 6))
                p["indices"] = g.accessor(
                    rng.integers(0, n, size).astype(draw(st.sampled_from(["u1", "u2", "u4"])))
                )
            if draw(st.booleans()):
                p["attributes"].pop("TEXCOORD_0", None)
            primitives.append(p)
        meshes.append({"primitives": primitives})
    g.tree["meshes"] = meshes
    g.scene(*({"mesh": k, "translation": [k, 0, 0.5]} for k in range(len(meshes))))
    return g.glb() if draw(st.booleans()) else g.gltf()


@settings(max_examples=40)
@given(gltf_files(), st.integers(0, 9), st.sampled_from([None, 0, 1, 2]))
def test_generated_trees_come_back(data: bytes, seed: int, uv_set: int | None) -> None:
    document = read_data(data)
    options = WriteOptions(uv_set=uv_set, overwrite_uv=uv_set is not None)
    for uvmap in (smooth_layout(document, seed), layout_with_seams(document, seed)):
        for format in ("glb", "gltf"):
            again = assert_round_trip(document, uvmap, format, options)
            assert_same_but_uv(document, again, f"TEXCOORD_{uv_set or 0}")
            assert again.uv_sets[: (uv_set or 0) + 1] == tuple(range((uv_set or 0) + 1))
    for format in ("obj", "ply"):
        assert_round_trip(document, layout_with_seams(document, seed), format)


@pytest.mark.parametrize("path", corpus_files(".glb", ".gltf"))
@pytest.mark.parametrize("uv_set", [None, 1])
@pytest.mark.parametrize("seams", [False, True])
def test_real_files_keep_everything_else(path: Path, uv_set: int | None, seams: bool) -> None:
    document = read(path)
    uvmap = layout_with_seams(document) if seams else smooth_layout(document)
    again = assert_round_trip(document, uvmap, "glb", WriteOptions(uv_set=uv_set))
    lost = () if uv_set else ("TANGENT",)
    assert_same_but_uv(document, again, f"TEXCOORD_{uv_set or 0}", *lost)
    assert unused_entries(again.tree.json) == unused_entries(document.tree.json)


@pytest.mark.parametrize("path", corpus_files(".glb"))
def test_real_files_read_as_trimesh_reads_them(path: Path) -> None:
    """trimesh is the independent reader: every geometry at its first node's place."""
    import trimesh

    document = read(path)
    scene = trimesh.load(path, process=False)
    seen, ours = {}, document.mesh.points[document.mesh.faces]
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        seen.setdefault(name, (matrix, scene.geometry[name]))
    theirs = np.concatenate(
        [trimesh.transform_points(g.vertices, m)[g.faces] for m, g in seen.values()]
    )
    assert theirs.shape == ours.shape
    size = np.abs(ours).max()

    def key(t: np.ndarray) -> np.ndarray:
        rows = t.reshape(-1, 9)
        return rows[np.lexsort(np.round(rows / size, 4).T)]

    # a set of triangles: the nodes may come in another order, and one of several instances may differ
    if document.instances == 0:
        np.testing.assert_allclose(key(theirs), key(ours), atol=1e-6 * size)


def test_features() -> None:
    expected = ("materials", "normals", "tangents", "vertex colours", "custom attributes", "morph targets",
                "extensions")  # fmt: skip
    g = full_mesh()
    assert read_data(g.scene({"mesh": 0}).glb()).features == expected
    g.scene({"mesh": 0}, {})
    g.tree |= {"cameras": [{}], "skins": [{}], "textures": [{}], "animations": []}
    features = read_data(g.glb()).features
    assert set(features) - set(expected) == {"nodes", "skins", "cameras", "textures"}
    assert read_data(small().scene({"mesh": 0}).glb()).features == ()
