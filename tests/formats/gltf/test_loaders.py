"""Interleaved, quantised and WebP files: what is written loads in three.js and assimp, with the uv in place."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.errors import NoResultError
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.editing import file_uv
from circparam.formats.gltf.unused import short_views
from circparam.formats.io import encode, read, read_data, stored
from circparam.mesh.mesh import UVMap
from circparam.pipeline.save import check_loadable
from tests.support.formats_tools import GltfMaker, corners, grid, layout_with_seams, smooth_layout
from tests.support.gltf_files import tree_of
from tests.support.loaders import faces_in_assimp, load_in_three


def interleaved(quantised: bool = False, webp: bool = False) -> bytes:
    """A grid with normals, uv and tangents in rows of one view, as gltf-transform writes them."""
    points, faces = grid(6)
    rng = np.random.default_rng(0)
    normals = np.tile(np.float32([0, 0, 1]), (36, 1))
    tangents = np.tile(np.float32([1, 0, 0, 1]), (36, 1))
    columns = {"POSITION": points, "NORMAL": normals, "TANGENT": tangents,
               "TEXCOORD_0": rng.random((36, 2)).astype("f4")}  # fmt: skip
    g = GltfMaker()
    if quantised:
        columns["POSITION"] = np.round(points / 5 * 32767).astype("i2")
        columns["NORMAL"] = (normals * 127).astype("i1")
        columns["TANGENT"] = (tangents * 127).astype("i1")
        columns["TEXCOORD_0"] = np.round(columns["TEXCOORD_0"] * 65535).astype("u2")
        g.tree |= {f"extensions{k}": ["KHR_mesh_quantization"] for k in ("Used", "Required")}
    raw = [c.view("u1").reshape(36, -1) for c in columns.values()]
    raw = [np.pad(r, ((0, 0), (0, -r.shape[1] % 4))) for r in raw]
    start = np.cumsum([0, *(r.shape[1] for r in raw)])
    view = g.view(np.concatenate(raw, 1).tobytes(), byteStride=int(start[-1]), target=34962)
    entry = {"normalized": True} if quantised else {}
    attributes = {
        name: g.accessor(c, view, int(at), **entry)
        for (name, c), at in zip(columns.items(), start, strict=False)
    }
    if quantised:
        place = g.tree["accessors"][attributes["POSITION"]]
        place |= {k: getattr(columns["POSITION"], k)(0).tolist() for k in ("min", "max")}
    primitive = {"attributes": attributes, "indices": g.accessor(faces.ravel().astype("u2"))}
    if webp:
        image = io.BytesIO()
        Image.new("RGB", (2, 2), "red").save(image, "WEBP")
        g.tree["images"] = [{"bufferView": g.view(image.getvalue()), "mimeType": "image/webp"}]
        g.tree["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
        g.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        g.tree["extensionsUsed"] = [*g.tree.get("extensionsUsed", []), "EXT_texture_webp"]
        g.tree["extensionsRequired"] = g.tree["extensionsUsed"]
        primitive["material"] = 0
    g.tree["meshes"] = [{"primitives": [primitive]}]
    return g.scene({"mesh": 0}).glb()


INPUTS = {
    "interleaved": interleaved(),
    "quantised": interleaved(quantised=True),
    "webp": interleaved(webp=True),
    "quantised-webp": interleaved(quantised=True, webp=True),
}
LAYOUTS: list[Callable[..., UVMap]] = [smooth_layout, layout_with_seams]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", INPUTS)
def test_views_keep_whole_rows(name: str, layout: Callable[..., UVMap]) -> None:
    """Uv and tangents, the last of each row, go or move: what is left of a view is count × stride long."""
    document = read_data(INPUTS[name])
    once = encode(document, layout(document), "glb").data
    again = read_data(once)
    twice = encode(again, layout(again), "glb").data
    for data in (once, twice):
        tree = tree_of(data)
        for a in tree["accessors"]:
            view = tree["bufferViews"][a["bufferView"]]
            stride, offset = view.get("byteStride", 1), a.get("byteOffset", 0)
            rows = a["count"] if "byteStride" in view else 0
            assert (offset // stride + rows) * stride <= view["byteLength"]
    assert len(twice) <= len(once) + 4, "nothing piles up"


def test_three_and_assimp_load_what_is_written(tmp_path: Path) -> None:
    paths, expected = [], []
    for name, data in INPUTS.items():
        document = read_data(data)
        for layout in LAYOUTS:
            path = tmp_path / f"{name}-{layout.__name__}.glb"
            uvmap = layout(document)
            path.write_bytes(encode(document, uvmap, "glb").data)
            paths.append(path)
            expected.append(np.unique(file_uv(uvmap.uv), axis=0))
    for path, uv, (mesh,) in zip(paths, expected, load_in_three(*paths), strict=True):
        np.testing.assert_allclose(np.unique(np.float32(mesh["uv"]), axis=0), uv, err_msg=path.name)
        assert mesh["triangles"] == 50
        assert mesh["map"] == ("webp" in path.name)
    plain = [path for path in paths if "quantised" not in path.name]  # assimp reads no such input
    assert [faces_in_assimp(path) for path in plain] == [50] * len(plain)


def cut_short() -> bytes:
    """A file as former versions wrote it: the view ends with the last normal, before the last row does."""
    data = interleaved()
    tree = tree_of(data)
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    del attributes["TEXCOORD_0"], attributes["TANGENT"]
    del tree["accessors"][2:4]
    tree["meshes"][0]["primitives"][0]["indices"] = 2
    tree["bufferViews"][0]["byteLength"] -= 24
    return glb_bytes(tree, bytes(read_data(data).tree.bin))


@pytest.mark.parametrize("careful", [False, True])
def test_views_that_came_cut_short_are_filled(careful: bool) -> None:
    data = cut_short()
    tree = tree_of(data)
    if careful:  # an extension that may hold data of its own
        tree["extensions"] = {"VENDOR_x": {"bufferView": 1}}
    document = read_data(glb_bytes(tree, bytes(read_data(data).tree.bin)))
    assert short_views(tree) == {0: 36 * 48}
    uvmap = smooth_layout(document)
    again = read_data(encode(document, uvmap, "glb").data)
    assert not short_views(again.tree.json)
    np.testing.assert_array_equal(again.mesh.points, document.mesh.points)
    np.testing.assert_array_equal(corners(again.uv()), corners(stored(uvmap, "glb")))


def test_verification_refuses_a_view_without_its_last_row(tmp_path: Path) -> None:
    path = tmp_path / "short.glb"
    path.write_bytes(cut_short())
    with pytest.raises(NoResultError, match=r"short\.glb: .*bufferView 0 ends 24 bytes"):
        check_loadable(read(path))
    path.write_bytes(interleaved())
    check_loadable(read(path))
