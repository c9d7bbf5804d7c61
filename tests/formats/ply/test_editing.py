"""Uv put into a PLY file: every other property is kept, strips and index types hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import InputError, OptionError
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read_data
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    assert_round_trip,
    layout_with_seams,
    smooth_layout,
)
from tests.support.ply_files import (
    ORDERS,
    build,
    naive,
    plain,
    sample,
    strip_file,
    triangles_of,
)


@pytest.mark.parametrize("encoding", ORDERS)
@pytest.mark.parametrize("uv", ["", "vertex", "face"])
@pytest.mark.parametrize("mode", ["vertex", "face", None])
@pytest.mark.parametrize("seams", [False, True])
def test_everything_but_uv_is_kept(encoding: str, uv: str, mode: str | None, seams: bool) -> None:
    data = sample(encoding, uv=uv)
    document = read_data(data)
    assert document.uv_sets == ((0,) if uv else ())
    uvmap = layout_with_seams(document) if seams else smooth_layout(document)
    out = encode(document, uvmap, "ply", options=WriteOptions(ply_uv=mode))
    old, new = naive(data), naive(out.data)
    at_faces = mode == "face" or (mode is None and seams)
    assert ("texcoord" in new["face"][0]) == at_faces
    assert ("s" in new["vertex"][0]) != at_faces
    n = len(old["vertex"])
    assert plain(new["vertex"])[:n] == plain(old["vertex"])
    duplicates = plain(new["vertex"])[n:]
    assert duplicates == [plain(old["vertex"])[k] for k in out.vertex_map[n:]]
    assert bool(duplicates) == (seams and not at_faces)
    for a, b in zip(plain(old["face"]), plain(new["face"]), strict=True):
        assert [out.vertex_map[k] for k in b.pop("vertex_indices")] == a.pop("vertex_indices")  # type: ignore[attr-defined]
        assert a == b
    assert {k: v for k, v in new.items() if k not in ("vertex", "face")} == {
        k: v for k, v in old.items() if k not in ("vertex", "face")
    }
    assert b"comment made by a test\nobj_info kept\n" in out.data
    assert_round_trip(document, uvmap, "ply", WriteOptions(ply_uv=mode))


@pytest.mark.parametrize("encoding", ORDERS)
def test_doubles_stay_doubles(encoding: str) -> None:
    data = sample(encoding, kind="double")
    document = read_data(data)
    out = encode(document, smooth_layout(document), "ply").data
    assert out.count(b"property double") == data.count(b"property double") == 5
    assert document.mesh.points.dtype == np.float64


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


@pytest.mark.parametrize("encoding", ORDERS)
def test_strips(encoding: str) -> None:
    rows = [[0, 3, 1, 4, 2, 5, -1, 3, 6, 4, 7, 7, 5, 5, 8], [6, 9, 7, 10]]
    document = read_data(strip_file(encoding, rows))
    assert document.mesh.faces.tolist() == [t for row in rows for t in triangles_of(row)]
    for uvmap in (smooth_layout(document), layout_with_seams(document)):
        assert_round_trip(document, uvmap, "ply")
    out = encode(document, smooth_layout(document), "ply").data
    assert [r["vertex_indices"] for r in naive(out)["tristrips"]] == rows
    with pytest.raises(OptionError, match="tristrips"):
        encode(document, smooth_layout(document), "ply", options=WriteOptions(ply_uv="face"))


@settings(max_examples=80)
@given(
    st.lists(st.lists(st.integers(-1, 11), min_size=1, max_size=14), min_size=1, max_size=3),
    st.integers(0, 5),
)
def test_any_strips_come_back(rows: list[list[int]], seed: int) -> None:
    expected = [t for row in rows for t in triangles_of(row)]
    data = strip_file("binary_little_endian", rows)
    if not expected:
        with pytest.raises(InputError, match="no faces"):
            read_data(data)
        return
    document = read_data(data)
    assert document.mesh.faces.tolist() == expected
    assert_round_trip(document, layout_with_seams(document, seed), "ply")


def test_indices_outgrow_their_type() -> None:
    """300 separate corners do not fit a uchar: the list gets a wider type."""
    n = 200
    points: list[list[object]] = [[float(k), float(k * k % 17), 0.0] for k in range(n)]
    faces: list[list[object]] = [[[k, k + 1, k + 2]] for k in range(n - 2)]
    data = build("binary_big_endian", {
        "vertex": (["float x", "float y", "float z"], points),
        "face": (["list uchar uchar vertex_indices"], faces),
    })  # fmt: skip
    document = read_data(data)
    m = len(document.mesh.faces)
    uvmap = UVMap(np.random.default_rng(0).random((3 * m, 2)), np.arange(3 * m).reshape(-1, 3))
    again = assert_round_trip(document, uvmap, "ply", WriteOptions(ply_uv="vertex"))
    assert len(again.mesh.points) == 3 * m
