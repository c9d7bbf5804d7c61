"""Out to disk and back: numbers, index maps and seams of the file."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import NoResultError, OptionError
from circparam.formats.memory import PlainDocument, from_arrays
from circparam.pipeline import save as saving
from circparam.pipeline.save import save, write_map
from tests.support import shapes

QUICK = {"effort": 0.01}
FLAT = {"cut": "none", "method": "mean-value", **QUICK}


def test_stored_numbers_are_what_the_file_holds(tmp_path: Path) -> None:
    """The layout of the result is bit for bit that of the file, in float32 and in text."""
    shape = shapes.bumped_disk(80)
    for name in ("o.glb", "o.obj", "o.ply"):
        result = circparam.unwrap(shape, tmp_path / name, **FLAT)
        memory = circparam.unwrap(shape, format=name[2:], **FLAT)
        again = circparam.read(tmp_path / name)
        uvmap = again.uv(0)
        np.testing.assert_array_equal(
            uvmap.uv[uvmap.uv_faces], result.uv[result.uv_faces][result.face_map]
        )
        np.testing.assert_array_equal(memory.uv[memory.uv_faces], result.uv[result.uv_faces])


def test_a_saved_result_names_its_file_and_its_maps(tmp_path: Path) -> None:
    result = circparam.unwrap(shapes.cube(1), **QUICK)
    with pytest.raises(OptionError, match="--map needs a written file"):
        write_map(result, tmp_path / "m.npz")
    written = save(result, tmp_path / "o.obj")
    assert result.path is None
    assert written.path == str(tmp_path / "o.obj")
    assert written.files[0] == written.path
    assert written.measures["flips"] == 0
    with pytest.raises(OptionError, match=r"ends in \.npz"):
        write_map(written, tmp_path / "m.zip")
    write_map(written, tmp_path / "m.npz")
    with np.load(tmp_path / "m.npz") as held:
        assert sorted(held) == ["chart", "face", "vertex"]
        np.testing.assert_array_equal(held["chart"], written.charts[held["face"]])
    with pytest.raises(OptionError, match="--overwrite"):
        save(result, tmp_path / "o.obj")


class Refused(PlainDocument):
    """A document whose file common loaders refuse."""

    def flaws(self) -> list[str]:
        return ["view 0 ends early"]


@pytest.mark.parametrize("fault", ["turned", "lost", "refused"])
def test_what_the_file_holds_is_verified_where_it_differs(fault, tmp_path, monkeypatch):
    """A writer that turns a face over or loses its uv is found out; numbers that come back are judged once."""
    memory = circparam.unwrap(shapes.bumped_disk(80), format="obj", **FLAT)
    assert save(memory, tmp_path / "good.obj").verification is memory.verification

    def bad(*given, **options):
        document = circparam.read(*given)
        if fault == "refused":
            return Refused(document.source, "obj", document.mesh)
        uvmap = document.uv()
        faces = uvmap.uv_faces.copy()
        faces[3] = faces[3, ::-1] if fault == "turned" else -1
        return from_arrays(document.mesh.points, document.mesh.faces, uvmap.uv, faces)

    monkeypatch.setattr(saving, "read", bad)
    if fault == "refused":
        with pytest.raises(NoResultError, match=r"bad\.obj: common loaders refuse .* view 0 ends"):
            save(memory, tmp_path / "bad.obj")
        return
    found = save(memory, tmp_path / "bad.obj")
    assert len(found.verification.mirrored) == (fault == "turned")
    assert found.verification.missing == (fault == "lost")
    assert found.status == "degraded"
