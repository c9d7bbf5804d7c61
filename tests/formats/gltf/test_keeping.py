"""Uv put into glTF trees: all else is kept, nothing piles up, and loaders read the result.

Every promise is checked for each kind of file, with seams and without, as GLB and as glTF.
"""

import base64
import io
import itertools
import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from circparam.errors import InputError
from circparam.formats.document import WriteOptions
from circparam.formats.gltf.buffers import glb_bytes, short_views
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.gltf.editing import file_uv
from circparam.formats.gltf.reading import Tree
from circparam.formats.io import encode, read, read_data, stored
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    GltfMaker,
    assert_round_trip,
    corners,
    corpus_files,
    grid,
    layout_with_seams,
    smooth_layout,
)
from tests.support.gltf_files import (
    assert_same_but_uv,
    full_mesh,
    instanced,
    tree_of,
    unused_entries,
)
from tests.support.node import run_node

# images are not decoded: node has no decoder of pictures, and the geometry is what counts here
LOAD = """
const fs = require('fs'), path = require('path'), {pathToFileURL} = require('url');
globalThis.self = globalThis;
globalThis.createImageBitmap = async () => ({width: 1, height: 1, close() {}});
const loader = path.join(process.env.NODE_PATH, 'three/examples/jsm/loaders/GLTFLoader.js');
import(pathToFileURL(loader)).then(async ({GLTFLoader}) => {
  for (const f of process.argv.slice(1)) {
    const data = fs.readFileSync(f);
    const file = data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength);
    const {scene} = await new GLTFLoader().parseAsync(file, '');
    const out = [];
    scene.traverse(o => { if (o.isMesh) {
      const of = name => { const a = o.geometry.attributes[name], rows = [];
        if (!a) return rows;
        for (let k = 0; k < a.count; k++) rows.push([a.getX(k), a.getY(k)]);
        return rows; };
      out.push({uv: of('uv'), position: of('position'), map: !!o.material.map,
                triangles: o.geometry.index.count / 3}); } });
    console.log(JSON.stringify(out)); }
});
"""


def load_in_three(*paths: Path) -> list[list[dict]]:
    """The meshes of each GLB as three.js has them: uv (n, 2), x and y of position, triangles, map."""
    return [json.loads(line) for line in run_node("three", LOAD, *paths)]


def faces_in_assimp(path: Path) -> int:
    """The number of faces that assimp imports; the test is skipped where assimp is missing."""
    program = shutil.which("assimp")
    if program is None:
        pytest.skip("assimp is not installed")
    run = subprocess.run([program, "info", str(path)], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout[-500:] + run.stderr[-500:]
    (line,) = [line for line in run.stdout.splitlines() if line.startswith("Faces:")]
    return int(line.split()[1])


LAYOUTS: list[Callable[..., UVMap]] = [smooth_layout, layout_with_seams]


def several_buffers() -> bytes:
    """Positions in one buffer, normals and indices in another of odd length before it, all data URIs."""
    points, faces = grid(3)
    normals = np.random.default_rng(3).normal(size=(9, 3)).astype("f4")
    g = GltfMaker()
    attributes = {"POSITION": g.accessor(points), "NORMAL": g.accessor(normals)}
    tree = json.loads(g.model(g.primitive(attributes, faces)).gltf())
    bodies = [points.tobytes(), b"????" + normals.tobytes(), faces.astype("u2").tobytes() + b"?"]
    tree["buffers"] = [
        {"byteLength": len(body), "uri": "data:;base64," + base64.b64encode(body).decode()}
        for body in bodies
    ]
    for k, view in enumerate(tree["bufferViews"]):
        view |= {"buffer": k, "byteOffset": 4 * (k == 1)}
    return json.dumps(tree).encode()


def sparse() -> bytes:
    """Interleaved positions and normalised uv; positions again with sparse values, and from zeros."""
    points, faces = grid(3)
    g = GltfMaker()
    raw = np.zeros(9, [("p", "<f4", 3), ("uv", "<u2", 2)])
    raw["p"], raw["uv"] = points, np.random.default_rng(0).integers(0, 65535, (9, 2))
    view = g.view(raw.tobytes(), byteStride=16)
    position = g.accessor(points, view)
    uv = g.accessor(raw["uv"], view, 12, normalized=True)
    at = {"bufferView": g.view(np.array([1, 4], "u1").tobytes()), "componentType": 5121}
    values = {"bufferView": g.view((points[[1, 4]] + 5).tobytes())}
    entry = {"sparse": {"count": 2, "indices": at, "values": values}}
    zeros = {"componentType": 5126, "type": "VEC3", "count": 9}
    g.tree["accessors"] += [{**g.tree["accessors"][position], **entry}, {**zeros, **entry}]
    index = g.accessor(faces.ravel().astype("u2"))
    primitives = [
        {
            "attributes": {"POSITION": p, "TEXCOORD_0": uv},
            "indices": index,
            "targets": [{"POSITION": uv + 2}],
        }
        for p in (position, uv + 1)
    ]
    return g.model(*primitives).glb()


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
    primitive = g.primitive(attributes, faces)
    if webp:
        image = io.BytesIO()
        Image.new("RGB", (2, 2), "red").save(image, "WEBP")
        g.tree["images"] = [{"bufferView": g.view(image.getvalue()), "mimeType": "image/webp"}]
        g.tree["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
        g.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        g.tree["extensionsUsed"] = [*g.tree.get("extensionsUsed", []), "EXT_texture_webp"]
        g.tree["extensionsRequired"] = g.tree["extensionsUsed"]
        primitive["material"] = 0
    return g.model(primitive).glb()


INPUTS = {
    "full": full_mesh(5).glb(),
    "without material": full_mesh(material=False).gltf(),
    "instanced": instanced().glb(),
    "several buffers": several_buffers(),
    "sparse": sparse(),
    **{f"mode {mode}": full_mesh(mode=mode).glb() for mode in (5, 6)},
    "interleaved": interleaved(),
    "quantised": interleaved(quantised=True),
    "webp": interleaved(webp=True),
    "quantised-webp": interleaved(quantised=True, webp=True),
}


def check_views(tree: Tree) -> None:
    """Views of accessors begin at whole words, share no byte, and hold whole rows."""
    spans = []
    for k in {a["bufferView"] for a in tree.json["accessors"] if "bufferView" in a}:
        view = tree.json["bufferViews"][k]
        start = view.get("byteOffset", 0)
        assert start % 4 == 0
        assert start + view["byteLength"] <= tree.json["buffers"][view["buffer"]]["byteLength"]
        spans.append((view["buffer"], start, start + view["byteLength"]))
    assert all(a[0] != b[0] or a[2] <= b[1] for a, b in itertools.pairwise(sorted(spans)))
    assert not short_views(tree.json)


def check_kept(
    document: GltfDocument, uvmap: UVMap, format: str, uv_set: int | None = None
) -> GltfDocument:
    """The layout comes back, all else is what it was, and no data is left that nothing uses."""
    options = WriteOptions(uv_set=uv_set, overwrite_uv=uv_set is not None)
    again = assert_round_trip(document, uvmap, format, options)
    check_views(again.tree)
    lost = () if uv_set else ("TANGENT", "0:TANGENT")
    assert_same_but_uv(document, again, f"TEXCOORD_{uv_set or 0}", *lost)
    for new, old in zip(
        unused_entries(again.tree.json), unused_entries(document.tree.json), strict=True
    ):
        assert len(new) <= len(old)
    return again


def total(document: GltfDocument) -> int:
    return sum(b["byteLength"] for b in document.tree.json.get("buffers", []))


def check_twice(
    document: GltfDocument, uvmap: UVMap, format: str, uv_set: int | None = None
) -> GltfDocument:
    """The same for a file that is written and written again: nothing piles up."""
    again = check_kept(document, uvmap, format, uv_set)
    twice = check_kept(again, again.uv(uv_set or 0), format, uv_set)
    if format == "glb" and uv_set is None:
        assert abs(total(twice) - total(again)) <= 4
        assert {v["buffer"] for v in again.tree.json["bufferViews"]} == {0}
    return again


@pytest.mark.parametrize("format", ["glb", "gltf"])
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", INPUTS)
def test_all_but_uv_is_kept(name: str, layout: Callable[..., UVMap], format: str) -> None:
    document = read_data(INPUTS[name])
    check_twice(document, layout(document), format)


def test_rows_that_are_written_hold_sparse_values() -> None:
    document = read_data(INPUTS["sparse"])
    split = tree_of(encode(document, layout_with_seams(document), "glb").data)["accessors"]
    assert not any("sparse" in accessor for accessor in split)


@pytest.mark.parametrize("path", corpus_files(".glb", ".gltf"))
@pytest.mark.parametrize("layout", LAYOUTS)
def test_real_files_keep_all_but_uv(path: Path, layout: Callable[..., UVMap]) -> None:
    document = read(path)
    for uv_set in (None, 1):
        check_kept(document, layout(document), "glb", uv_set)


def placed(draw: st.DrawFn, g: GltfMaker, arrays: dict[str, np.ndarray]) -> dict[str, int]:
    """Accessors of arrays in any order: a view each, or in one view, behind each other or in rows."""
    names = draw(st.permutations(sorted(arrays)))
    how = draw(st.sampled_from(["apart", "behind", "rows"]))
    g.bin += draw(st.sampled_from([b"", KEPT]))
    if how == "apart" or not names:
        return {name: g.accessor(arrays[name]) for name in names}
    raw = [arrays[name].view("u1").reshape(len(arrays[name]), -1) for name in names]
    if how == "behind":
        start, view = np.cumsum([0, *(r.size for r in raw)]), g.view(b"".join(map(bytes, raw)))
    else:
        start = np.cumsum([0, *(r.shape[1] for r in raw)])
        view = g.view(np.concatenate(raw, 1).tobytes(), byteStride=int(start[-1]))
    at = dict(zip(names, start.tolist(), strict=False))
    return {name: g.accessor(arrays[name], view, at[name]) for name in names}


KEPT = b"keepthis"  # bytes that no view covers


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
        arrays = {"POSITION": points}
        for name in draw(
            st.lists(
                st.sampled_from(["NORMAL", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0", "_ID"]),
                unique=True,
            )
        ):
            kind, width = {"NORMAL": ("f4", 3), "COLOR_0": ("u2", 4), "_ID": ("f4", 1)}.get(
                name, ("f4", 2)
            )
            arrays[name] = rng.integers(0, 9, (n, width)).astype(kind)
        attributes = {}
        if draw(st.integers(0, 3)) == 0:  # zeros need no data; the new uv do
            del arrays["POSITION"]
            attributes["POSITION"] = len(g.tree["accessors"])
            g.tree["accessors"].append({"componentType": 5126, "type": "VEC3", "count": n})
        attributes |= placed(draw, g, arrays)
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
    if size := draw(st.integers(0, 7)):  # an image of any length ends the buffer
        image = g.view(bytes(range(1, size + 1)))
        g.tree["images"] = [{"bufferView": image, "mimeType": "image/png"}]
    g.scene(*({"mesh": k, "translation": [k, 0, 0.5]} for k in range(len(meshes))))
    return g.glb() if draw(st.booleans()) else g.gltf()


@settings(max_examples=40)
@given(gltf_files(), st.integers(0, 9), st.sampled_from([None, 0, 1, 2]))
def test_generated_trees_come_back(data: bytes, seed: int, uv_set: int | None) -> None:
    document = read_data(data)
    for layout, format in itertools.product(LAYOUTS, ("glb", "gltf")):
        again = check_twice(document, layout(document, seed), format, uv_set)
        if format == "glb" and document.tree.bin:
            assert (again.tree.bin or b"").count(KEPT) == bytes(document.tree.bin).count(KEPT)
        assert again.uv_sets[: (uv_set or 0) + 1] == tuple(range((uv_set or 0) + 1))
    for format in ("obj", "ply"):
        assert_round_trip(document, layout_with_seams(document, seed), format)


def test_three_and_assimp_load_what_is_written(tmp_path: Path) -> None:
    paths, expected = [], []
    kinds = ("interleaved", "quantised", "webp", "quantised-webp")
    loadable = {name: INPUTS[name] for name in kinds}
    for name, data in loadable.items():
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


def test_a_view_without_its_last_row_is_a_flaw() -> None:
    (flaw,) = read_data(cut_short()).flaws()
    assert "bufferView 0 ends 24 bytes" in flaw
    assert not read_data(interleaved()).flaws()
    g = full_mesh()
    del next(view for view in g.tree["bufferViews"] if "byteStride" in view)["byteLength"]
    with pytest.raises(InputError, match="byteLength"):  # of colours, which nobody has asked for
        read_data(g.glb()).flaws()


@pytest.mark.parametrize("kind", ["KHR_draco_mesh_compression", "EXT_meshopt_compression"])
def test_a_compressed_copy_beside_plain_data_is_left_out(kind: str) -> None:
    """An extension that is used and not required: every reader may take the plain data."""
    g = full_mesh(6)
    stale = bytes(range(200, 250)) * 20
    view = g.view(stale)
    (primitive,) = g.tree["meshes"][0]["primitives"]
    if kind.startswith("KHR_draco"):
        primitive["extensions"] = {kind: {"bufferView": view, "attributes": {"POSITION": 0}}}
    else:
        count = {"buffer": 0, "byteOffset": 0, "byteLength": 9, "byteStride": 12, "count": 36}
        g.tree["bufferViews"][0]["extensions"] = {kind: {**count, "mode": "ATTRIBUTES"}}
    g.tree["extensionsUsed"].append(kind)
    document, plain = read_data(g.glb()), read_data(full_mesh(6).glb())
    assert any("compressed copies" in note for note in document.notes)
    again = read_data(encode(document, layout_with_seams(document), "glb").data)
    assert_same_but_uv(plain, again, "TEXCOORD", "TANGENT", "0:TANGENT")
    assert kind.encode() not in json.dumps(again.tree.json).encode()
    if kind.startswith("KHR_draco"):
        assert stale not in again.tree.bin
        assert unused_entries(again.tree.json) == (set(), set())
