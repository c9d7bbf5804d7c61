"""New files from any mesh: what each format holds, what it loses and says so, judged by others too."""

from pathlib import Path

import pytest

from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read, read_data, write
from tests.support.formats_tools import (
    OFF,
    assert_round_trip,
    corpus_files,
    layout_with_seams,
    smooth_layout,
)
from tests.support.validator import validate


@pytest.mark.parametrize("format", ["ply", "glb", "gltf", "obj"])
def test_groups_and_polygons_go_where_they_can(format: str) -> None:
    text = (
        b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nvn 0 0 1\nusemtl red one\nf 1//1 2//1 3//1 4//1\n"
        b"usemtl blue\nf 2 5 3\nusemtl red one\nf 1 3 5\n"
    )
    doc = read_data(text)
    again = assert_round_trip(doc, layout_with_seams(doc), format)
    if format != "obj":
        note = encode(doc, smooth_layout(doc), format).notes[0]
        assert note.startswith("not carried")
        assert "normals" in note
        assert ("polygons" in note) == (format != "ply")
    if format == "ply":
        assert again.mesh.polygons is not None
    else:
        assert again.group_names == ("red one", "blue")
        face_map = encode(doc, layout_with_seams(doc), format).face_map
        named = [again.group_names[k] for k in again.mesh.groups]
        expected = doc.mesh.groups[face_map]
        assert named == [doc.group_names[k] for k in expected]
    back = encode(again, again.uv(), "obj").data
    if format == "glb":
        assert b"usemtl red_one\n" in back
        assert b"usemtl blue\n" in back


def test_the_validator_finds_nothing_in_new_files(tmp_path: Path) -> None:
    doc = read_data(OFF)
    paths = []
    for seams in (False, True):
        for format in ("glb", "gltf"):
            paths.append(tmp_path / f"{seams}.{format}")
            write(paths[-1], doc, layout_with_seams(doc) if seams else smooth_layout(doc))
    assert validate(*paths) == [set()] * 4


@pytest.mark.parametrize("path", corpus_files(".glb"))
def test_the_validator_finds_nothing_new_in_real_files(tmp_path: Path, path: Path) -> None:
    doc = read(path)
    paths = [path]
    for k, uv_set in enumerate((None, 1)):
        for format in ("glb", "gltf"):
            paths.append(tmp_path / f"{k}.{format}")
            write(paths[-1], doc, layout_with_seams(doc), options=WriteOptions(uv_set=uv_set))
    before, *after = validate(*paths)
    # tangents belong to the uv they were made from: without them a viewer makes its own
    tangents = {"MESH_PRIMITIVE_GENERATED_TANGENT_SPACE"}
    dropped = tangents if "tangents" in doc.features else set()
    for found in after:
        assert found <= before | dropped
