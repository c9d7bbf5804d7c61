"""STL: three points a face, in the order of the file."""

import io
import sys

import numpy as np
import pytest
import trimesh

from circparam.formats.io import read_data
from tests.support import writers
from tests.support.formats_tools import grid, refused

FACET = (
    b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
)


def stl() -> tuple[bytes, np.ndarray]:
    points, faces = grid(4)
    return b"solid not ascii".ljust(80) + writers.stl(points, faces)[80:], points[faces]


def test_corners_at_one_position_are_one_vertex() -> None:
    data, corner = stl()
    mesh = read_data(data).mesh
    np.testing.assert_array_equal(mesh.points[mesh.faces], corner)
    assert len(mesh.points) == 16
    assert mesh.faces[0].tolist() == [0, 1, 2]  # by their first corner
    for bad in (data[:-7], data[:90], b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n"):
        refused(bad, "", "stl")


def test_scenes_of_several_solids_are_groups() -> None:
    raised = FACET.replace(b"vertex 0 0 0", b"vertex 1 1 1")
    solids = [b"solid a\n" + FACET + b"endsolid a\n", b"solid b\n" + 2 * raised + b"endsolid b\n"]
    mesh = read_data(b"".join(solids)).mesh
    assert mesh.points[mesh.faces][:, 0, 0].tolist() == [0, 1, 1]
    assert mesh.groups.tolist() == [0, 1, 1]
    one = read_data(solids[0])
    assert one.mesh.groups is None
    refused(bytes(84), "no faces", "stl")


def test_files_are_read_as_trimesh_reads_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Binary ones and texts: the same points and faces, and nothing is imported for them."""
    data, _ = stl()
    theirs = trimesh.load(io.BytesIO(data), file_type="stl", process=False)
    monkeypatch.setitem(sys.modules, "trimesh", None)  # an import of it fails
    for document in (read_data(data), read_data(writers.stl_text(*grid(4)))):
        mine = document.mesh
        np.testing.assert_array_equal(mine.points[mine.faces], theirs.vertices[theirs.faces])
        assert (document.format, mine.points.dtype) == ("stl", np.float64)


def test_what_is_wrong_with_an_stl_without_facets_is_told() -> None:
    data, corner = stl()
    n = len(corner)
    more = data[:80] + np.uint32(1000).tobytes() + data[84:]
    none = data[:80] + np.uint32(0).tobytes() + data[84:]
    text = b"solid x\n" + 2 * FACET + FACET[:60]
    for bad, says in (
        (more, f"promises 1000 facets, its length is that of {n}: it is cut short"),
        (none, f"promises 0 facets, its length is that of {n}"),
        (data[:-7], f"promises {n} facets, its length is that of {n - 1}: it is cut short"),
        (bytes(60), "its 60 bytes are shorter than the header of an STL: it is cut short"),
        (b"solid " + data[6:-7], "it is cut short"),
        (data + data[-50:], "promises 18 facets, its length is that of 19: whatever wrote it"),
        (text, "3 facets begin and 2 end: it is cut short"),
        (b"solid x\nendsolid x\n", "no faces"),
        (b"solid outer loop endloop\n", "line 1: a facet is not three times"),
    ):
        refused(bad, says, "stl")


def test_bytes_behind_the_last_facet_are_left_out_and_told() -> None:
    data, corner = stl()
    document = read_data(data + b"made by a scanner", format="stl")
    np.testing.assert_array_equal(document.mesh.points[document.mesh.faces], corner)
    assert document.warnings == ("17 bytes behind the last facet were left out",)
    assert read_data(data).warnings == ()


def test_texts_of_any_program_are_read() -> None:
    """Names in any encoding, a byte order mark, any white space, capitals, words of other programs."""
    text = (
        b"solid Caf\xe9 facet vertex endsolid\n" + FACET + b"color 1 0 0\n" + FACET + b"endsolid\n"
    )
    for same in (
        text, b"\xef\xbb\xbf" + text, b"\n\n " + text, text.upper(), text.replace(b"\n", b"\r\n"),
        text.replace(b"\n", b"\r"), text.replace(b"\n", b"\t "), text.replace(b"facet normal 0 0 1", b"facet"),
    ):  # fmt: skip
        document = read_data(same, format="stl")
        mesh = document.mesh
        expected = 2 * [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]
        np.testing.assert_array_equal(mesh.points[mesh.faces], expected)
        assert document.warnings == ()
    refused(text[:90], "cut short", "stl")


@pytest.mark.parametrize(
    ("second", "says"),
    [
        (b"solid b\n" + FACET + FACET[:50], "3 facets begin and 2 end: it is cut short"),
        (
            b"solid b\n" + FACET.replace(b"1 0 0", b"1,5 0 0"),
            "line 14: '1,5' .* write decimal points",
        ),
        (b"solid b\nouter loop endloop", "line 11: a facet is not three times"),
        (b"solid b\n" + FACET.replace(b"1 0 0", b"1 0"), "line 12: a facet is not three times"),
        (b"solid b\n" + FACET.replace(b"endloop", b"vertex 1 1 0\nendloop"), "line 12: a facet is"),
    ],
)
def test_no_solid_of_a_text_is_left_out(second: bytes, says: str) -> None:
    """A second solid that is cut short or damaged is an error; one without an end comes with a warning."""
    first = b"solid a\n" + FACET + b"endsolid a\n"
    refused(first + second, says, "stl")
    document = read_data(first + b"solid b\n" + FACET)
    assert len(document.mesh.faces) == 2
    assert "cut short" in document.warnings[0]
