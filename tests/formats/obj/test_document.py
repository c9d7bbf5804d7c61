"""OBJ: read as an independent, naive reader reads it, and written back with every other byte kept."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import OptionError
from circparam.formats.io import encode, read_data
from tests.support.formats_tools import assert_round_trip, corners, layout_with_seams, smooth_layout
from tests.support.obj_files import naive, without_uv


def test_groups_stand_in_where_no_material_is_named() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\ng one\nf 1 2 3\no two\nf 3 2 1\ng one\nf 2 3 1\n"
    document = read_data(data, format="obj")
    assert document.mesh.groups is not None
    assert document.mesh.groups.tolist() == [0, 1, 0]
    assert document.group_names == ("one", "two")


def test_labels_for_grouping() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\no p\nf 3 2 1\nusemtl b\nf 1 2 3\no q\nf 2 3 1\n"
    document = read_data(data, format="obj")
    assert document.labels("primitive").tolist() == [0, 0, 1, 1]
    assert document.labels("mesh").tolist() == [0, 1, 1, 2]
    assert document.labels("scene").tolist() == [0, 0, 0, 0]
    with pytest.raises(OptionError, match="grouping"):
        document.labels("page")


@st.composite
def obj_files(draw: st.DrawFn) -> bytes:
    """OBJ files with everything that may stand in one."""
    newline = draw(st.sampled_from(["\n", "\r\n"]))
    n, k = draw(st.integers(3, 9)), draw(st.integers(0, 4))
    number = st.sampled_from(["0", "1", "-2.5", "1e-3", "0.1", "3.", ".5", "+4", "1E+2"])
    noise = st.sampled_from(
        ["", "# vt f v", "o part", "g a b", "s 1", "usemtl m1", "usemtl m2", "mtllib a.mtl",
         "p 1", "l 1 2", "xyz 1/2/3", "   ", "vp 0 1", "\tg tab", "usemtl"]
    )  # fmt: skip
    lines = []
    for _ in range(n):
        extra = draw(st.sampled_from(["", " 1.0", " 0.5 0.5 0.5", "  # colour"]))
        lines.append("v " + " ".join(draw(number) for _ in range(3)) + extra)
        lines.append(draw(noise))
    for _ in range(k):
        lines.append("vt " + " ".join(draw(number) for _ in range(draw(st.integers(1, 3)))))
    lines.append("vn 0 0 1")
    for _ in range(draw(st.integers(1, 5))):
        lines.append(draw(noise))
        size = draw(st.integers(3, min(n, 6)))
        order = draw(st.permutations(range(n)))[:size]
        relative = draw(st.booleans())
        form = draw(st.sampled_from(["v", "v/t", "v//n", "v/t/n"] if k else ["v", "v//n"]))
        words = []
        for v in order:
            t = draw(st.integers(1, k)) if k else 0
            word = form.replace("n", "1").replace("t", str(t - k - 1 if relative else t))
            words.append(word.replace("v", str(v - n if relative else v + 1)))
        gap = draw(st.sampled_from([" ", "  ", "\t", " \\" + newline + " "]))
        lines.append("f " + gap.join(words) + draw(st.sampled_from(["", " ", " # f 1 2 3"])))
    lines.append(draw(noise))
    return newline.join(line for line in lines).encode()


@settings(max_examples=40)
@given(obj_files(), st.integers(0, 9))
def test_generated_files_come_back(data: bytes, seed: int) -> None:
    document = read_data(data, format="obj")
    points, polygons, uv = naive(data)
    np.testing.assert_array_equal(document.mesh.points, points)
    polys = document.polygons()
    assert polys.corners.tolist() == [k for p in polygons for k in p]
    read = document.uv()
    flat = [k for p in uv for k in p]
    if read is not None:
        for got, corner in zip(corners(read).reshape(-1, 2), polys.triangles.ravel(), strict=True):
            want = flat[corner]
            assert np.isnan(got).all() if want is None else tuple(got) == want
    else:
        assert not any(flat)
    for uvmap in (smooth_layout(document, seed), layout_with_seams(document, seed)):
        out = encode(document, uvmap, "obj")
        assert without_uv(out.data) == without_uv(data)
        assert_round_trip(document, uvmap, "obj")
        twice = encode(read_data(out.data, format="obj"), uvmap, "obj")
        assert twice.data == out.data  # writing the same uv again changes nothing
    for format in ("ply", "glb"):
        assert_round_trip(document, layout_with_seams(document, seed), format)
