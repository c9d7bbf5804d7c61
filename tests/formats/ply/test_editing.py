"""Uv put into a PLY file: every other property is kept, strips and index types hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read_data
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import assert_round_trip, layout_with_seams, refused, smooth_layout
from tests.support.ply_files import naive, plain, sample, strip_file, triangles_file, triangles_of


def test_names_of_the_uv_are_kept() -> None:
    data = (
        sample("ascii", uv="vertex")
        .replace(b"float s\n", b"float texture_u\n")
        .replace(b"float t\n", b"float texture_v\n")
    )
    document = read_data(data)
    assert document.uv_sets == (0,)
    out = encode(document, smooth_layout(document), "ply").data
    assert b"property float texture_u\nproperty float texture_v\n" in out
    assert b"property float s\n" not in out


@settings(max_examples=80)
@given(
    st.lists(st.lists(st.integers(-1, 11), min_size=1, max_size=14), min_size=1, max_size=3),
    st.integers(0, 5),
)
def test_any_strips_come_back(rows: list[list[int]], seed: int) -> None:
    expected = [t for row in rows for t in triangles_of(row)]
    data = strip_file("binary_little_endian", rows)
    if not expected:
        refused(data, "no faces")
        return
    document = read_data(data)
    assert document.mesh.faces.tolist() == expected
    assert_round_trip(document, layout_with_seams(document, seed), "ply")


@pytest.mark.parametrize("n", [254, 255, 256])
def test_the_last_index_of_a_type_is_used(n: int) -> None:
    """n + 1 vertices after the split: index 255 fits a uchar, 256 does not."""
    points = [[k, k * k % 17, 0] for k in range(n)]
    faces, index = [[0, 1, 2], [0, 2, n - 1]], "list uchar uchar vertex_indices"
    document = read_data(triangles_file("binary_little_endian", points, faces, index))
    uvmap = UVMap(np.random.default_rng(0).random((5, 2)), np.array([[0, 1, 2], [4, 2, 3]]))
    out = encode(document, uvmap, "ply", options=WriteOptions(ply_uv="vertex")).data
    assert (b"list uchar int" in out) == (n + 1 > 256)
    assert naive(out)["face"][1]["vertex_indices"] == [n, 2, n - 1]


def test_what_lies_behind_the_elements_is_kept() -> None:
    data = sample("binary_little_endian", uv="face") + b"\0behind"
    document = read_data(data)
    for place in ("vertex", "face"):
        out = encode(document, smooth_layout(document), "ply", options=WriteOptions(ply_uv=place))
        assert out.data.endswith(b"\0behind")


@pytest.mark.parametrize("newline", [b"\r\n", b"\r"])
def test_line_ends_are_kept(newline: bytes) -> None:
    data = sample("ascii").replace(b"\n", newline)
    document = read_data(data)
    for uvmap in (smooth_layout(document), layout_with_seams(document)):
        out = encode(document, uvmap, "ply").data
        assert b"\n" not in out.replace(newline, b"")
        back = naive(out.replace(newline, b"\n"))
        old = plain(naive(sample("ascii"))["vertex"])
        assert plain(back["vertex"])[: len(old)] == old
