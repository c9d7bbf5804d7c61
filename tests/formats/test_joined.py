"""Several files as one document: they lie apart, keep what they have, and get their share of a layout back."""

import numpy as np
import pytest

from circparam.formats.document import Document
from circparam.formats.io import read_data
from circparam.formats.joined import JoinedDocument, join
from tests.support.formats_tools import OFF, corners, smooth_layout
from tests.support.gltf_files import full_mesh

OBJ = b"""v 0 0 0 1 0 0
v 1 0 0 1 0 0
v 1 1 0 1 0 0
v 0 1 0 1 0 0
vt 0.5 0
vt 1 0
vt 1 1
usemtl skin
f 1/1 2/2 3/3
usemtl bare
f 1 3 4
"""


@pytest.fixture(scope="module")
def parts() -> list[Document]:
    """Colours, materials and a face without uv; normals, tangents and uv; polygons and nothing else."""
    scene = full_mesh()
    scene.tree["materials"] = [{"name": "m"}]
    return [read_data(OBJ), read_data(scene.glb()), read_data(OFF)]


@pytest.fixture(scope="module")
def whole(parts: list[Document]) -> JoinedDocument:
    return join(parts)


def test_parts_lie_apart_each_moved_as_a_whole(parts, whole) -> None:
    boxes = []
    for k, part in enumerate(parts):
        mine = whole.mesh.corners[whole.faces_of(k)]
        away = mine - part.mesh.corners
        np.testing.assert_array_equal(away, np.broadcast_to(away[0, 0], away.shape))
        boxes.append((mine.min((0, 1)), mine.max((0, 1))))
    for low, high in boxes:
        beside = [(low > h).any() or (high < g).any() for g, h in boxes]
        assert beside.count(False) == 1, "only itself"
    np.testing.assert_array_equal(join(parts[:1]).mesh.points, parts[0].mesh.points)


def test_each_part_gets_its_share_of_a_layout_back(parts, whole) -> None:
    """Its own uv where they were joined, and of a new layout the rows that it uses."""
    joined, new = whole.uv(), smooth_layout(whole)
    for k, part in enumerate(parts):
        if part.uv() is not None:
            np.testing.assert_array_equal(corners(whole.layout_of(k, joined)), corners(part.uv()))
        share = whole.layout_of(k, new)
        np.testing.assert_array_equal(corners(share), corners(new)[whole.faces_of(k)])
        assert len(np.unique(share.uv_faces)) == len(share.uv)


@pytest.mark.parametrize("what", ["colours", "normals", "tangents"])
def test_what_a_part_lacks_is_plain(what: str, parts, whole) -> None:
    """White, smooth, or unknown."""
    found = getattr(whole, what)()
    for k, part in enumerate(parts):
        own, mine = getattr(part, what)(), found[whole.faces_of(k)]
        if own is not None:
            np.testing.assert_array_equal(mine, own)
        elif what == "normals":
            np.testing.assert_allclose(np.linalg.norm(mine, axis=2), 1)
        else:
            assert (mine == 1).all() if what == "colours" else np.isnan(mine).all()


def test_labels_of_two_parts_are_never_the_same(parts, whole) -> None:
    for labels in (whole.mesh.groups, whole.mesh.polygons, whole.looks().face):
        sets = [set(labels[whole.faces_of(k)].tolist()) for k in range(len(parts))]
        assert len(set.union(*sets)) == sum(map(len, sets))
    assert len(np.unique(whole.mesh.polygons)) == 2 + len(parts[1].mesh.faces) + 3
    named = whole.named("material")
    assert {name for name, _ in named.names} == {"skin", "bare", "m"}
    (skin,) = (number for name, number in named.names if name == "skin")
    assert np.flatnonzero(named.label == skin).tolist() == [0]


def test_shared_uv_are_stored_to_the_bit_by_every_format(whole) -> None:
    """u, v and 1 − v are float32, also far out."""
    rng = np.random.default_rng(3)
    uv = np.concatenate([rng.random((1000, 2)), rng.normal(0, 300, (1000, 2)), [[0, 0], [1, 1]]])
    stored = whole.rounded(uv)
    for numbers in (stored, 1 - stored[:, 1]):
        np.testing.assert_array_equal(numbers.astype(np.float32), numbers)
    np.testing.assert_allclose(stored[:1000], uv[:1000], atol=2**-24)
    np.testing.assert_allclose(stored, uv, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(whole.rounded(stored), stored)
