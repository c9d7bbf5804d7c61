"""Files that lie, lead elsewhere or are garbage: one clear line, bounded memory, nothing written."""

from __future__ import annotations

import copy
import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import CircparamError, InputError
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.io import encode, read, read_data
from circparam.formats.memory import from_arrays
from tests.support.formats_tools import GltfMaker, grid, smooth_layout


def small() -> GltfMaker:
    points, faces = grid(3)
    g = GltfMaker()
    position = g.accessor(points)
    index = g.accessor(faces.ravel().astype("u2"))
    g.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": position}, "indices": index}]}]
    return g.scene({"mesh": 0}, {"name": "empty"})


def refused(data: bytes, says: str, format: str | None = None) -> None:
    with pytest.raises(InputError, match=says) as caught:
        read_data(data, format=format)
    assert "\n" not in str(caught.value)


# glTF -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (("accessors", 0, "count"), 4_000_000_000, "promises 4000000000"),
        (("accessors", 1, "count"), 4_000_000_000, "promises 4000000000"),
        (("accessors", 0, "count"), -1, "whole number"),
        (("accessors", 0, "count"), 1e300, "whole number|promises"),
        (("accessors", 0, "count"), "9", "whole number"),
        (("accessors", 0, "componentType"), 1, "malformed"),
        (("accessors", 0, "type"), "VEC9", "malformed"),
        (("accessors", 0, "type"), "VEC2", "VEC3"),
        (("accessors", 0, "bufferView"), 7, "no entry 7"),
        (("accessors", 0, "bufferView"), -1, "no entry -1"),
        (("accessors", 0, "byteOffset"), 4_000_000_000, "promises"),
        (("accessors", 1, "componentType"), 5126, "whole numbers"),
        (("bufferViews", 0, "byteLength"), 4_000_000_000, "beyond its buffer"),
        (("bufferViews", 0, "byteOffset"), 4_000_000_000, "beyond its buffer"),
        (("bufferViews", 0, "byteStride"), 4_000_000_000, "promises"),
        (("bufferViews", 0, "buffer"), 3, "no entry 3"),
        (("buffers", 0, "byteLength"), 4_000_000_000, "promises 4000000000 bytes"),
        (("nodes", 0, "children"), [0], "cycle|two parents"),
        (("nodes", 0, "children"), [1, 1], "two parents"),
        (("nodes", 0, "children"), [9], "no entry 9"),
        (("nodes", 0, "mesh"), 9, "no entry 9"),
        (("nodes", 0, "matrix"), [1, 2], "malformed"),
        (("nodes", 0, "translation"), [1, 2, "x"], "malformed"),
        (("scenes", 0, "nodes"), [5], "no entry 5"),
        (("scenes", 0, "nodes"), [1], "no triangles"),
        (("meshes", 0, "primitives"), [], "no triangles"),
        (("meshes", 0, "primitives", 0, "mode"), 0, "no triangles"),
        (("meshes", 0, "primitives", 0, "attributes"), [], "malformed|no triangles"),
        (("meshes", 0, "primitives", 0, "attributes", "POSITION"), 99, "no entry 99"),
        (("meshes",), {}, "no list|no entry"),
        (("meshes", 0), None, "malformed"),
        (("asset",), {"version": "1.0"}, "version"),
        (("asset",), None, "asset"),
        (("extensionsRequired",), ["KHR_draco_mesh_compression"], "KHR_draco_mesh_compression"),
        (("extensionsRequired",), ["EXT_meshopt_compression"], "EXT_meshopt_compression"),
        (("bufferViews", 0, "extensions"), {"EXT_meshopt_compression": {}}, "EXT_meshopt_compression"),
    ],
)  # fmt: skip
def test_trees_that_lie(path: tuple, value: object, says: str) -> None:
    g = small()
    g.glb()
    tree = copy.deepcopy(g.tree)
    place = tree
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    refused(glb_bytes(tree, bytes(g.bin)), says)


def test_draco_is_named() -> None:
    g = small()
    g.tree["meshes"][0]["primitives"][0]["extensions"] = {
        "KHR_draco_mesh_compression": {"bufferView": 0}
    }
    refused(g.glb(), "KHR_draco_mesh_compression")


def test_long_cycles_end() -> None:
    g = small()
    n = 2000
    g.tree["nodes"] = [{"children": [(k + 1) % n]} for k in range(n)]
    refused(g.glb(), "cycle")
    g.tree["nodes"] = [{"children": [k + 1]} for k in range(n - 1)] + [{"mesh": 0}]
    g.tree["scenes"] = [{"nodes": [0]}]
    assert len(read_data(g.glb()).mesh.faces) == 8  # deep, but a tree


@pytest.mark.parametrize(
    "uri",
    ["../x.bin", "/etc/passwd", "http://host/x.bin", "file:///x.bin", "a/../../x.bin", "..\\x.bin",
     "C:\\x.bin", "%2e%2e/x.bin", "a%2F..%2F..%2Fx.bin", "//host/x.bin", "x\0.bin"],
)  # fmt: skip
def test_buffers_elsewhere_are_refused_and_not_read(
    tmp_path: Path, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    g = small()
    (tmp_path / "x.bin").write_bytes(g.bin)
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "m.gltf").write_bytes(g.gltf(uri))
    opened = []
    real = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda p: (opened.append(p.name), real(p))[1])
    with pytest.raises(InputError, match=r"m\.gltf.*outside"):
        read(folder / "m.gltf")
    assert opened == ["m.gltf"]


def test_a_link_that_leads_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    g = small()
    (tmp_path / "x.bin").write_bytes(g.bin)
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "m.gltf").write_bytes(g.gltf("x.bin"))
    (folder / "x.bin").symlink_to(tmp_path / "x.bin")
    with pytest.raises(InputError, match="outside"):
        read(folder / "m.gltf")
    (folder / "x.bin").unlink()
    with pytest.raises(InputError, match=r"x\.bin.*No such file"):
        read(folder / "m.gltf")
    (folder / "x.bin").write_bytes(g.bin[:-1])
    with pytest.raises(InputError, match="promises"):
        read(folder / "m.gltf")
    (folder / "x.bin").write_bytes(g.bin)
    assert len(read(folder / "m.gltf").mesh.faces) == 8


def test_buffers_from_standard_input_need_a_path() -> None:
    refused(small().gltf("x.bin"), "standard input")


def test_glb_chunks_that_lie() -> None:
    good = bytearray(small().glb())
    assert len(read_data(bytes(good)).mesh.faces) == 8
    for at, value in ((8, 2**32 - 1), (12, 2**32 - 1), (16, 7), (4, 1), (4, 3)):
        bad = good.copy()
        struct.pack_into("<I", bad, at, value)
        refused(bytes(bad), "GLB")
    for end in range(4, len(good)):
        with pytest.raises(InputError):
            read_data(bytes(good[:end]), format="glb")
    refused(b"glTF" + b"\xff" * 100, "GLB")


@pytest.mark.parametrize(
    "text",
    [b"{", b"[]", b"{}", b'{"asset":{"version":"2.0"}}', b'{"asset":{"version":"2.0","x":NaN}}',
     b"[" * 100_000, b'{"asset":' * 50_000, b'{"asset":{"version":"2.0"},"meshes":[{"primitives":7}]}',
     b'{"asset":{"version":"2.0"},"buffers":[7]}', b'{"asset":{"version":"2.0"},"buffers":7}',
     b'{"asset":{"version":"2.0"},"nodes":7}', b'\xff\xfe{"asset":{}}'],
)  # fmt: skip
def test_json_that_is_no_gltf(text: bytes) -> None:
    refused(text, ".", "gltf")


def test_few_bytes_do_not_become_many_vertices() -> None:
    """Ten thousand meshes that all show the same big accessor."""
    g = GltfMaker()
    position = g.accessor(np.zeros((20_000, 3), "f4"))
    g.tree["meshes"] = [
        {"primitives": [{"attributes": {"POSITION": position}}]} for _ in range(10_000)
    ]
    refused(g.scene(*({"mesh": k} for k in range(10_000))).glb(), "more vertices than its data")


def test_no_data_for_billions_of_zeros() -> None:
    g = small()
    g.tree["accessors"][0].pop("bufferView")
    g.tree["accessors"][0]["count"] = 4_000_000_000
    refused(g.glb(), "promises")


# every format ---------------------------------------------------------------------------------------


def samples() -> dict[str, bytes]:
    points, faces = grid(3)
    doc = from_arrays(points, faces)
    out = {f: encode(doc, smooth_layout(doc), f).data for f in ("obj", "ply", "glb", "gltf")}
    rows = np.zeros(len(faces), [("n", "<f4", 3), ("p", "<f4", 9), ("a", "<u2")])
    rows["p"] = points[faces].reshape(-1, 9)
    out["stl"] = bytes(80) + np.uint32(len(faces)).tobytes() + rows.tobytes()
    out["off"] = b"OFF\n9 8 0\n" + b"".join(
        b" ".join(b"%g" % x for x in row) + b"\n" for row in points.tolist()
    ) + b"".join(b"3 %d %d %d\n" % tuple(f) for f in faces.tolist())  # fmt: skip
    return out


SAMPLES = samples()


def read_or_refuse(data: bytes, format: str | None, output: str) -> None:
    """Nothing but an error of circparam's own, in one line; a mesh that is read can be written."""
    message = ""
    try:
        document = read_data(data, format=format)
        document.uv()
        encode(document, smooth_layout(document), output)
    except CircparamError as error:
        message = str(error)
    assert "\n" not in message


@settings(max_examples=200)
@given(
    st.sampled_from(sorted(SAMPLES)),
    st.lists(st.tuples(st.integers(0, 5000), st.integers(0, 255)), max_size=6),
    st.one_of(st.none(), st.integers(0, 5000)),
    st.booleans(),
)
def test_spoiled_files_are_read_or_refused(
    format: str, edits: list[tuple[int, int]], end: int | None, known: bool
) -> None:
    """Nothing but an error of circparam's own, in one line; a mesh that is read can be written."""
    data = bytearray(SAMPLES[format])
    for at, value in edits:
        data[at % len(data)] = value
    text = bytes(data[:end] if end is not None else data)
    read_or_refuse(text, format if known else None, "obj")


@settings(max_examples=200)
@given(st.sampled_from(sorted(SAMPLES)), st.binary(max_size=300))
def test_garbage_is_refused(format: str, data: bytes) -> None:
    for name in (format, None):
        with pytest.raises(CircparamError) as caught:
            read_data(data, format=name)
        assert "\n" not in str(caught.value)


TOP = ["meshes", "nodes", "scenes", "accessors", "bufferViews", "buffers", "materials"]
KEYS = [*TOP, "primitives", "attributes", "POSITION", "mesh", "children", "count", "type", "targets",
        "componentType", "indices"]  # fmt: skip
any_json = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-5, 99)
    | st.floats(allow_nan=False)
    | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=4)
    ),
    max_leaves=12,
)


@settings(max_examples=200)
@given(any_json, st.sampled_from(TOP))
def test_trees_of_any_shape_are_refused(value: object, key: str) -> None:
    g = small()
    g.gltf()
    g.tree[key] = value
    read_or_refuse(json.dumps(g.tree).encode(), "gltf", "glb")


@pytest.mark.parametrize("format", sorted(SAMPLES))
def test_missing_empty_directory_unreadable(tmp_path: Path, format: str) -> None:
    path = tmp_path / f"x.{format}"
    for make, says in (
        (lambda: None, "no such file"),
        (lambda: path.write_bytes(b""), "empty"),
        (lambda: path.write_bytes(b" \n\n"), "empty"),
        (lambda: path.write_bytes(os.urandom(64) + b"\0\xff"), "."),
        (lambda: path.write_bytes(SAMPLES[format][:40]), "."),
        (lambda: (path.unlink(), path.mkdir()), "directory"),
    ):
        make()  # type: ignore[no-untyped-call]
        with pytest.raises(InputError, match=says) as caught:
            read(path)
        assert str(caught.value).startswith(str(path))
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "none.obj")


LIMITED = """
import resource, sys
from circparam.errors import InputError
from circparam.formats import read
import numpy, trimesh, scipy.sparse.csgraph
used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 200_000_000,) * 2)
for path in sys.argv[1:]:
    try:
        read(path)
    except InputError as error:
        print(str(error).replace(path, ''))
    else:
        print('read')
"""


@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="address space is limited on Linux"
)
def test_memory_is_bounded(tmp_path: Path) -> None:
    """Counts of billions are refused within 200 MB of address space, and not as a lack of memory."""
    g = small()
    g.glb()
    lies = {}
    for k, (name, key) in enumerate((("accessors", "count"), ("bufferViews", "byteLength"))):
        tree = copy.deepcopy(g.tree)
        tree[name][0][key] = 4_000_000_000
        lies[f"{k}.glb"] = glb_bytes(tree, bytes(g.bin))
    tree = copy.deepcopy(g.tree)
    tree["accessors"][0] |= {"count": 4_000_000_000}
    tree["accessors"][0].pop("bufferView")
    lies["2.glb"] = glb_bytes(tree, bytes(g.bin))
    lies["3.ply"] = SAMPLES["ply"].replace(b"vertex 9", b"vertex 4000000000")
    lies["4.ply"] = SAMPLES["ply"].replace(b"face 8", b"face 4000000000")
    lies["5.off"] = SAMPLES["off"].replace(b"9 8 0", b"9 4000000000 0")
    lies["6.stl"] = bytes(80) + np.uint32(2**32 - 1).tobytes() + bytes(100)
    lies["7.obj"] = SAMPLES["obj"].replace(b"f 1/1", b"f 4000000000/1")
    lies["8.ply"] = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n" \
        b"property float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n" \
        b"0 0 0 1 0 0 0 1 0\n4000000000 0 1 2\n"  # fmt: skip
    lies["9.ply"] = SAMPLES["ply"].replace(
        b"element face 8", b"element none 4000000000\nelement face 8"
    )
    paths = []
    for name, data in lies.items():
        paths.append(tmp_path / name)
        paths[-1].write_bytes(data)
    run = subprocess.run(
        [sys.executable, "-c", LIMITED, *map(str, paths)], capture_output=True, text=True, check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    lines = run.stdout.strip().split("\n")
    assert len(lines) == len(lies)
    for line in lines[:-1]:
        assert line != "read"
        assert "memory" not in line.lower(), line
    assert (
        lines[-1] == "read"
    )  # an element without properties takes no room, however many rows it has
