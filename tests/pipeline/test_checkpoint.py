"""A stopped run goes on after its seams, with the bytes of an unbroken one, and never with others' seams."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam.core.monitor import Monitor
from circparam.errors import OutputError
from circparam.pipeline.checkpoint import checkpoint_path
from circparam.pipeline.configure import open_source
from circparam.pipeline.job import prepare
from circparam.pipeline.options import Options
from circparam.pipeline.unwrap import unwrap_document
from tests.support import shapes
from tests.support.command_line import obj

QUICK: dict[str, Any] = {"effort": 0.01}


class Stopped(BaseException):
    """In place of a kill: nothing of the library catches it."""


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    return obj(tmp_path / "m.obj", shapes.torus(24, 12))


def stopped(mesh: Path, folder: Path, *output: Path) -> Path:
    """The file that a run leaves which is stopped right after its seams."""

    def stop(stage: str, *_: object) -> None:
        if stage == "flatten":
            raise Stopped

    with pytest.raises(Stopped):
        circparam.unwrap(mesh, *output, checkpoint=str(folder), listener=stop, **QUICK)
    (kept,) = folder.iterdir()
    return kept


def found_seams(mesh: Path, folder: Path, *output: Path, **options: Any) -> bool:
    """Whether a run with a folder of checkpoints looks for charts."""
    stages: set[str] = set()
    more: dict[str, Any] = {**QUICK, **options, "listener": lambda *at: stages.add(at[0])}
    circparam.unwrap(mesh, *output, checkpoint=str(folder), **more)
    return "charts" in stages


@pytest.mark.parametrize("suffix", ["obj", "glb"])
def test_it_goes_on_with_the_same_bytes(suffix: str, mesh: Path, tmp_path: Path) -> None:
    folder, whole, again = (
        tmp_path / "new" / "c",
        tmp_path / f"a.{suffix}",
        tmp_path / f"b.{suffix}",
    )
    circparam.unwrap(mesh, whole, **QUICK)
    stopped(mesh, folder, again)
    assert not again.exists()
    assert not found_seams(mesh, folder, again, jobs=1)
    assert again.read_bytes().replace(b"b.mtl", b"a.mtl") == whole.read_bytes()
    assert not list(folder.iterdir())


def test_other_paint_is_another_mesh(tmp_path: Path) -> None:
    """Seams of --seam-weights colour depend on the colours of the file."""
    points, faces = shapes.torus(12, 6)
    names = set()
    for red in (0.0, 1.0):
        rows = [f"v {x!r} {y!r} {z!r} {red} 0 0\n" for x, y, z in points.tolist()]
        rows += [f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist()]
        (tmp_path / "m.obj").write_text("".join(rows))
        options = Options(checkpoint=str(tmp_path), seam_weights="colour")
        document = open_source(tmp_path / "m.obj", options)
        names.add(checkpoint_path(prepare(document, None, options, Monitor())))
    assert len(names) == 2


def test_another_mesh_option_or_version_is_never_mistaken_for_it(mesh, tmp_path, monkeypatch):
    kept = stopped(mesh, tmp_path / "c")
    assert found_seams(mesh, kept.parent, max_distortion=1.04)
    points, faces = shapes.torus(24, 12)
    points[7, 2] = np.nextafter(points[7, 2], 1)
    assert found_seams(obj(mesh.with_name("other.obj"), (points, faces)), kept.parent)
    assert kept.exists()
    monkeypatch.setattr("circparam.pipeline.checkpoint.__version__", "0")
    assert found_seams(mesh, kept.parent)


@pytest.mark.parametrize("damage", ["short", "shape"])
def test_a_damaged_checkpoint_is_told_and_done_without(damage, mesh, tmp_path):
    kept = stopped(mesh, tmp_path / "c")
    data = kept.read_bytes()
    kept.write_bytes(data[: len(data) // 2])
    if damage == "shape":
        np.savez(kept, cut=np.zeros(3, bool), notes=np.array([], np.str_))
    result = circparam.unwrap(mesh, checkpoint=str(kept.parent), **QUICK)
    assert any("damaged" in note for note in result.notes)
    assert np.array_equal(result.uv, circparam.unwrap(mesh, **QUICK).uv)


def test_seams_found_in_a_hurry_are_not_kept(mesh: Path, tmp_path: Path) -> None:
    def hurry(stage: str, *_: object) -> None:
        monitor.late |= stage == "charts"
        if stage == "flatten":
            raise Stopped

    monitor = Monitor(listener=hurry)
    options = circparam.Options(checkpoint=str(tmp_path / "c"), **QUICK)
    with pytest.raises(Stopped):
        unwrap_document(open_source(mesh, options), None, options, monitor)
    assert not list(tmp_path.glob("c/*"))


def test_folders_that_cannot_be_are_refused(mesh: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="checkpoints"):
        circparam.unwrap(mesh, checkpoint=str(tmp_path / "file" / "c"))
