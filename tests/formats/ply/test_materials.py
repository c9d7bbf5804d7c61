"""Colours of vertices and faces by the range of their type, and the image of a TextureFile comment."""

from pathlib import Path

import numpy as np
import pytest

from circparam.formats.io import read, read_data
from tests.support.ply_files import INDEX, ORDERS, THREE, XYZ, build, triangles_file

POINTS = [*THREE[:2], [1, 1, 0], THREE[2]]


def channels(kind: str) -> list[str]:
    return [f"{kind} {c}" for c in ("red", "green", "blue")]


@pytest.mark.parametrize("encoding", ORDERS)
@pytest.mark.parametrize(
    ("kind", "full", "part"), [("uchar", 255, 51), ("ushort", 65535, 13107), ("float", 1.0, 0.2)]
)
def test_colours_of_vertices(encoding: str, kind: str, full: object, part: object) -> None:
    rows = [[*p, full, 0, part] for p in POINTS]
    rows[3][3:] = [0, full, 0]
    data = build(encoding, {"vertex": (XYZ + channels(kind), rows),
                            "face": ([INDEX], [[[0, 1, 2]], [[3, 2, 0]]])})  # fmt: skip
    colours = read_data(data).colours()
    one, other = [1, 0, 0.2], [0, 1, 0]
    np.testing.assert_allclose(colours, [[one] * 3, [other, one, one]], atol=1e-7)


def test_colours_of_faces_and_of_the_triangles_of_polygons() -> None:
    data = build("ascii", {
        "vertex": (XYZ, POINTS),
        "face": ([INDEX, *channels("uchar")], [[[0, 1, 2, 3], 255, 0, 0], [[0, 1, 2], 0, 0, 255]]),
        "tristrips": (["list int int vertex_indices"], [[[0, 1, 2]]]),
    })  # fmt: skip
    colours = read_data(data).colours()
    red, blue, white = [1, 0, 0], [0, 0, 1], [1, 1, 1]
    assert colours.tolist() == [[red] * 3, [red] * 3, [blue] * 3, [white] * 3]


def test_vertices_come_before_faces_and_two_channels_are_none() -> None:
    face: tuple = [INDEX, *channels("uchar")], [[[0, 1, 2], 0, 0, 255]]
    both = {"vertex": (XYZ + channels("uchar"), [[*p, 255, 0, 0] for p in POINTS]), "face": face}
    colours = read_data(build("ascii", both)).colours()
    assert colours[0].tolist() == [[1, 0, 0]] * 3
    two = (XYZ + channels("uchar")[:2], [[*p, 255, 0] for p in POINTS])
    without = {"vertex": two, "face": ([INDEX], [[[0, 1, 2]]])}
    assert read_data(build("ascii", without)).colours() is None


def test_the_image_of_a_comment(tmp_path: Path) -> None:
    data = triangles_file("ascii", POINTS, [[0, 1, 2, 3]])
    (tmp_path / "p.ply").write_bytes(data)
    assert read(tmp_path / "p.ply").textures() is None
    named = data.replace(b"comment made by a test", b"comment TextureFile  a b.png ")
    (tmp_path / "p.ply").write_bytes(named)
    found = read(tmp_path / "p.ply").textures()
    assert found.face.tolist() == [-1, -1]
    assert found.notes == ["texture a b.png is missing: put it beside the mesh"]
    (tmp_path / "a b.png").write_bytes(b"p")
    found = read(tmp_path / "p.ply").textures()
    assert (found.face.tolist(), found.images, found.notes) == ([0, 0], (b"p",), [])
    assert found.plain.tolist() == [[1, 1, 1]] * 2
