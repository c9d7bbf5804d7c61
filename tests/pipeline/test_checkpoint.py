"""A stopped run goes on after its seams, with the bytes of an unbroken one, and never with others' seams."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.core.monitor import Monitor
from circparam.errors import OptionError, OutputError
from circparam.pipeline import unwrap as spine
from tests.support import shapes


class Stopped(BaseException):
    """In place of a kill: nothing of the library catches it."""


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    points, faces = shapes.torus(24, 12)
    path = tmp_path / "m.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    path.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]))
    return path


def stop(*_: object) -> None:
    raise Stopped


def stopped(mesh: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, **options: object) -> Path:
    """The file that a run leaves which is stopped right after its seams."""
    with monkeypatch.context() as patch:
        patch.setattr(spine, "first_layout", stop)
        with pytest.raises(Stopped):
            circparam.unwrap(mesh, checkpoint=str(folder), **options)
    (kept,) = folder.iterdir()
    return kept


def found(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Counts how often seams are found."""
    calls: list[int] = []
    find = spine.find_seams

    def noted(*given: object) -> object:
        calls.append(1)
        return find(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(spine, "find_seams", noted)
    return calls


@pytest.mark.parametrize("suffix", ["obj", "glb", "ply"])
def test_it_goes_on_with_the_same_bytes(
    suffix: str, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, whole, again = tmp_path / "c", tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    circparam.unwrap(mesh, whole)
    with monkeypatch.context() as patch:
        patch.setattr(spine, "first_layout", stop)
        with pytest.raises(Stopped):
            circparam.unwrap(mesh, again, checkpoint=str(folder))
    assert not again.exists()
    calls = found(monkeypatch)
    circparam.unwrap(mesh, again, checkpoint=str(folder), jobs=1)
    assert not calls
    assert again.read_bytes().replace(b"b.mtl", b"a.mtl") == whole.read_bytes()
    assert not list(folder.iterdir())


def test_another_mesh_or_option_is_never_mistaken_for_it(
    mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = stopped(mesh, tmp_path / "c", monkeypatch)
    calls = found(monkeypatch)
    circparam.unwrap(mesh, checkpoint=str(kept.parent), max_distortion=1.04)
    assert len(calls) == 1
    moved = mesh.with_name("other.obj")
    points, faces = shapes.torus(24, 12)
    points[7, 2] = np.nextafter(points[7, 2], 1)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    moved.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]))
    circparam.unwrap(moved, checkpoint=str(kept.parent))
    assert len(calls) == 2
    assert kept.exists()
    monkeypatch.setattr("circparam.pipeline.checkpoint.__version__", "0")
    circparam.unwrap(mesh, checkpoint=str(kept.parent))
    assert len(calls) == 3


@pytest.mark.parametrize("damage", ["short", "empty", "shape", "noise"])
def test_a_damaged_checkpoint_is_told_and_done_without(
    damage: str, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = stopped(mesh, tmp_path / "c", monkeypatch)
    data = kept.read_bytes()
    if damage == "shape":
        np.savez(kept, cut=np.zeros(3, bool), notes=np.array([], np.str_))
    else:
        kept.write_bytes(
            {"short": data[: len(data) // 2], "empty": b"", "noise": b"x" * 999}[damage]
        )
    calls = found(monkeypatch)
    result = circparam.unwrap(mesh, checkpoint=str(kept.parent))
    assert calls
    assert any("damaged" in note for note in result.notes)
    assert np.array_equal(result.uv, circparam.unwrap(mesh).uv)


def test_seams_found_in_a_hurry_are_not_kept(
    mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = spine.find_seams

    def late(job: object, monitor: Monitor) -> object:
        monitor.late = True
        return find(job, monitor)  # type: ignore[arg-type]

    monkeypatch.setattr(spine, "find_seams", late)
    with monkeypatch.context() as patch:
        patch.setattr(spine, "first_layout", stop)
        with pytest.raises(Stopped):
            circparam.unwrap(mesh, checkpoint=str(tmp_path / "c"))
    assert not list(tmp_path.glob("c/*"))


def test_folders_that_cannot_be_and_cuts_without_charts_are_refused(
    mesh: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="checkpoints"):
        circparam.unwrap(mesh, checkpoint=str(tmp_path / "file" / "c"))
    with pytest.raises(OptionError, match="checkpoint"):
        circparam.unwrap(mesh, cut="disk", checkpoint=str(tmp_path))
