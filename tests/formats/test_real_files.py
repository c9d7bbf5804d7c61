"""Real and made files: the triangles that trimesh finds, and names of what a file holds beyond triangles."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from circparam.formats.document import Document
from circparam.formats.io import read, read_data
from circparam.mesh.mesh import Mesh
from tests.support.formats_tools import corpus_files, some_corpus_files
from tests.support.gltf_files import full_mesh, small
from tests.support.ply_files import INDEX, THREE, XYZ, build


def spread(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m, 5) centres of triangles along five directions, each in order."""
    along = np.random.default_rng(0).normal(size=(3, 5))
    return np.sort(np.asarray(points)[faces].mean(1) @ along, 0)


def assert_triangles_of_trimesh(path: Path, document: Document) -> None:
    if document.mesh.polygons is not None or "tristrips" in document.features:
        pytest.skip("trimesh cuts polygons by another rule, and reads no strips")
    whole = trimesh.load(path, process=False, maintain_order=True)
    whole = whole.to_mesh() if isinstance(whole, trimesh.Scene) else whole
    ours, theirs = (
        spread(m.points, m.faces) for m in (document.mesh, Mesh(whole.vertices, whole.faces))
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-5 * np.abs(ours).max())


@pytest.mark.parametrize("path", corpus_files(most=1e6))
def test_triangles_are_those_of_trimesh(path: Path) -> None:
    assert_triangles_of_trimesh(path, read(path, unshare=True))


@pytest.mark.parametrize("path", some_corpus_files("CesiumMilkTruck.glb"))
def test_the_second_reader_finds_the_same_triangles(path: Path) -> None:
    assert_triangles_of_trimesh(path, read(path, reader="trimesh"))


FACE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def ply(lines: list[str], *, strips: bool = False) -> bytes:
    elements: dict = {"vertex": (XYZ + lines, [row + [0] * len(lines) for row in THREE])}
    elements["face"] = ([INDEX], [[[0, 1, 2]]])
    if strips:
        elements["tristrips"] = (["list int int vertex_indices"], [[[0, 1, 2]]])
    return build("ascii", elements)


ALL = full_mesh().scene({"mesh": 0}, {})
ALL.tree |= {"cameras": [{}], "skins": [{}], "textures": [{}], "animations": []}


@pytest.mark.parametrize(
    ("data", "features"),
    [
        (FACE, ""),
        (b"v 1 1 1 1\n" + FACE, ""),
        (b"v 1 1 1 0.5 0.5 0.5\n" + FACE, "vertex colours"),
        (b"vn 0 0 1\nusemtl x\n" + FACE, "normals, materials"),
        (b"g x\ns 1\np 1\n" + FACE, "groups, smoothing groups, line and point elements"),
        (b"o x\nl 1 2\n" + FACE + b"f 1 2 3 1\n", "polygons, groups, line and point elements"),
        (ply([]), ""),
        (ply(["float s", "float t"]), ""),
        (ply(["float nx", "uchar alpha"]), "normals, colours"),
        (ply(["float quality"], strips=True), "custom properties, tristrips"),
        (small().scene({"mesh": 0}).glb(), ""),
        (
            ALL.glb(),
            "materials, textures, normals, tangents, vertex colours, custom attributes, "
            "morph targets, nodes, skins, cameras, extensions",
        ),
        (b"OFF 3 1\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", ""),
        (b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n", "colours or normals"),
    ],
)
def test_features_of_a_file_are_named(data: bytes, features: str) -> None:
    assert ", ".join(read_data(data).features) == features
