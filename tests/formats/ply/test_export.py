"""A new PLY file from any mesh: where uv go, which types hold what, read by an independent reader."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from circparam.formats import Polygons
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read_data
from circparam.formats.memory import PlainDocument, from_arrays
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap
from tests.support.formats_tools import grid, layout_with_seams, smooth_layout
from tests.support.ply_files import naive


def fan(n: int) -> PlainDocument:
    """One polygon of n corners."""
    a = 2 * np.pi * np.arange(n) / n
    points = np.stack([np.cos(a), np.sin(a), 0 * a], 1).astype("f4").astype(float)
    k = np.arange(1, n - 1)
    triangles = np.stack([0 * k, k, k + 1], 1)
    polys = Polygons(np.arange(n), np.array([0, n]), triangles, np.zeros(n - 2, np.int64))
    mesh = Mesh(points, triangles, polygons=polys.labels)
    return PlainDocument(Source("x"), "off", mesh, polys=polys)


@pytest.mark.parametrize("again", [False, True])
def test_other_programs_read_the_default(tmp_path: Path, again: bool) -> None:
    """meshio and trimesh find the uv of every corner, in a new file and in one that is written back; points
    that single precision holds are stored in it."""
    doc = from_arrays(*grid(4))
    if again:
        doc = read_data(encode(doc, smooth_layout(doc), "ply").data)
    expected = layout_with_seams(doc)
    path = tmp_path / "o.ply"
    path.write_bytes(encode(doc, expected, "ply").data)
    assert b"property float x" in path.read_bytes()
    corners = expected.uv.astype("f4")[expected.uv_faces]
    loaded = trimesh.load(path, process=False)
    np.testing.assert_array_equal(loaded.visual.uv[loaded.faces].astype("f4"), corners)
    meshio = pytest.importorskip("meshio")
    found = meshio.read(path)
    uv = np.stack([found.point_data["s"], found.point_data["t"]], 1)
    np.testing.assert_array_equal(uv[found.cells_dict["triangle"]], corners)


@pytest.mark.parametrize(("place", "last"), [("vertex", 255), ("face", 127)])
def test_list_lengths_outgrow_a_byte(place: str, last: int) -> None:
    """A byte counts 255 corners; of uv it counts pairs, so 127."""
    for n, kind in ((last, b"list uchar"), (last + 1, b"list int")):
        doc = fan(n)
        uvmap = UVMap(np.random.default_rng(0).random((n, 2)), doc.mesh.faces)
        data = encode(doc, uvmap, "ply", options=WriteOptions(ply_uv=place)).data
        assert kind in data
        rows = naive(data)
        assert rows["face"][0]["vertex_indices"] == list(range(n))
        if place == "face":
            got = np.array(rows["face"][0]["texcoord"]).reshape(-1, 2)
            np.testing.assert_array_equal(got, uvmap.uv.astype("f4"))
        again = read_data(data).uv()
        assert len(again.uv) == n
