"""Files made on the spot for the tests of ``circparam.formats``, and comparisons of what comes back."""

from __future__ import annotations

import base64
import json
import math
import os

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.document import Document, WriteOptions
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.io import encode, read_data, stored
from circparam.formats.table import up_of
from circparam.mesh.mesh import UVMap
from tests.support import shapes
from tests.support.corpus import CORPUS, SUFFIXES

# a quad and two triangles, with a vertex that float32 does not hold
OFF = b"""OFF # comment
# another
6 3 0
0 0 0
1 0 0
1 1 0 # here too
0 1 0
0.1 0.30000000000000004 1
2 0 0

4 0 1 2 3 255 0 0
3 0 1 4
3 1 5 2
"""


def corpus_files(*suffixes: str, most: float = math.inf) -> list[object]:
    """The real meshes with those suffixes, or one skipped test where there are none.

    most: bytes of files that are always taken; larger ones where the whole corpus is asked for.
    """
    most = math.inf if os.environ.get("CIRCPARAM_WHOLE_CORPUS") else most
    found = sorted(p for p in CORPUS.glob("*") if p.suffix.lower() in (suffixes or SUFFIXES))
    found = [p for p in found if p.stat().st_size <= most]
    if not found:
        skip = pytest.mark.skip(reason="the folder of real meshes is not here")
        return [pytest.param(None, marks=[skip, pytest.mark.corpus])]
    return [pytest.param(p, id=p.name, marks=pytest.mark.corpus) for p in found]


def some_corpus_files(*names: str) -> list[object]:
    """The real meshes of those names; all where the whole corpus is asked for (``make test-corpus``)."""
    found = corpus_files()
    if os.environ.get("CIRCPARAM_WHOLE_CORPUS"):
        return found
    return [p for p in found if p.id is None or p.id in names]


def layout_with_seams(document: Document, seed: int = 0, parts: int = 3) -> UVMap:
    """A layout with seams between random groups of polygons; numbers that float32 can't hold."""
    rng = np.random.default_rng(seed)
    mesh = document.mesh
    polygon = np.arange(len(mesh.faces)) if mesh.polygons is None else mesh.polygons
    part = rng.integers(0, parts, int(polygon.max()) + 1)[polygon]
    key = part[:, None] * len(mesh.points) + mesh.faces
    used, index = np.unique(key, return_inverse=True)
    return UVMap(rng.random((len(used), 2)), index.reshape(-1, 3))


def smooth_layout(document: Document, seed: int = 0) -> UVMap:
    """One uv for every vertex: no seam splits anything."""
    rng = np.random.default_rng(seed)
    return UVMap(rng.random((len(document.mesh.points), 2)), document.mesh.faces)


def corners(uvmap: UVMap) -> np.ndarray:
    """(m, 3, 2) uv of every corner; NaN where there is none."""
    table = np.concatenate([uvmap.uv, [[np.nan, np.nan]]])
    return table[uvmap.uv_faces]


def assert_round_trip(
    document: Document, uvmap: UVMap, format: str, options: WriteOptions | None = None
) -> Document:
    """Write, read again: the uv is ``stored``, the surface and its order are the input's."""
    options = options or WriteOptions()
    out = encode(document, uvmap, format, options=options)
    again = read_data(out.data, format=format)
    result = again.uv(options.uv_set or 0)
    expected = stored(uvmap, format, document if document.format == format else None)
    np.testing.assert_array_equal(corners(result), corners(expected)[out.face_map])
    mesh, new = document.mesh, again.mesh
    np.testing.assert_array_equal(out.vertex_map[new.faces], mesh.faces[out.face_map])
    points = mesh.points[out.vertex_map]
    if format in ("gltf", "glb") and document.format not in ("gltf", "glb"):
        if (options.up or up_of(document.format)) == "z":  # glTF has y up
            points = points[:, [0, 2, 1]] * [1, 1, -1]
        # far from the origin a node holds the place: as near as float32, if not the same numbers
        near = 2.0**-23 * np.abs(points).max(initial=0.0) + 2.0**-149
        np.testing.assert_allclose(new.points[new.faces], points[new.faces], rtol=0, atol=near)
    else:
        np.testing.assert_array_equal(new.points[new.faces], points[new.faces])
    # input vertices first: in the whole file, or in glTF among the vertices that primitives share
    n = len(mesh.points)
    pools, new_pools = [(0, n)], [0]
    if isinstance(document, GltfDocument) and isinstance(again, GltfDocument):
        pools = [(p.first, p.count) for p in document.pools]
        new_pools = [p.first for p in again.pools]
    for (first, count), at in zip(pools, new_pools, strict=True):
        np.testing.assert_array_equal(out.vertex_map[at : at + count], first + np.arange(count))
    return again


class GltfMaker:
    """Builds a small glTF tree; every array gets a view of its own unless told otherwise."""

    def __init__(self) -> None:
        self.bin = bytearray()
        self.tree: dict = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": []}

    def view(self, data: bytes, **entry: int) -> int:
        self.bin += b"\0" * (-len(self.bin) % 4)
        self.tree["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.bin), "byteLength": len(data), **entry}
        )
        self.bin += data
        return len(self.tree["bufferViews"]) - 1

    def accessor(
        self, array: np.ndarray, view: int | None = None, offset: int = 0, **entry: object
    ) -> int:
        array = np.ascontiguousarray(array)
        code = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
        width = 1 if array.ndim == 1 else array.shape[1]
        a: dict = {
            "bufferView": self.view(array.tobytes()) if view is None else view,
            "componentType": code[array.dtype.str[1:]],
            "count": len(array),
            "type": {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[width],
            **entry,
        }
        if offset:
            a["byteOffset"] = offset
        if width == 3 and array.dtype == np.float32:
            a |= {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
        self.tree["accessors"].append(a)
        return len(self.tree["accessors"]) - 1

    def primitive(self, attributes: dict[str, int], faces: np.ndarray, **entry: object) -> dict:
        """Triangles (m, 3) of vertices with these accessors."""
        indices = self.accessor(faces.ravel().astype("u2"))
        return {"attributes": dict(attributes), "indices": indices, **entry}

    def model(self, *primitives: dict) -> GltfMaker:
        """One mesh of these primitives, which one node shows."""
        self.tree["meshes"] = [{"primitives": list(primitives)}]
        return self.scene({"mesh": 0})

    def scene(self, *nodes: dict) -> GltfMaker:
        self.tree |= {
            "nodes": list(nodes),
            "scenes": [{"nodes": list(range(len(nodes)))}],
            "scene": 0,
        }
        return self

    def glb(self) -> bytes:
        self.tree["buffers"] = [{"byteLength": len(self.bin)}]
        return glb_bytes(self.tree, bytes(self.bin))

    def gltf(self, uri: str | None = None) -> bytes:
        data = "data:application/octet-stream;base64," + base64.b64encode(bytes(self.bin)).decode()
        self.tree["buffers"] = [{"byteLength": len(self.bin), "uri": uri or data}]
        return json.dumps(self.tree).encode()


def grid(n: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """A bumpy grid of n × n float32 points and its triangles."""
    points, faces = shapes.grid(n, n, n - 1.0, n - 1.0)
    points[:, 2] = np.sin(points[:, 0]) * np.cos(points[:, 1])
    return points.astype(np.float32), faces


def refused(data: bytes, says: str = "", format: str | None = None) -> None:
    """Data that no document is made of: an error of one line says why."""
    with pytest.raises(InputError, match=says or None) as caught:
        read_data(data, format=format)
    assert "\n" not in str(caught.value)
