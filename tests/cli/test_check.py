"""``circparam check``: topology with known answers, uv with planted faults."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.support import shapes
from tests.support.command_line import obj, one_line_error, report, run

KNOWN = {
    "two handles": (shapes.handles(2), "genus 2, closed", -2, 2, 0),
    "annulus": (shapes.annulus(), "genus 0 with 2 boundaries", 0, 0, 2),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_topology(name: str, tmp_path: Path) -> None:
    shape, verdict, euler, genus, boundaries = KNOWN[name]
    mesh = obj(tmp_path / "m.obj", shape)
    got = report("check", mesh)
    assert got["schema"] == "circparam/check/1"
    assert (got["euler"], got["genus"], got["boundaries"]) == (euler, genus, boundaries)
    assert got["borders"] == got["boundaries"]  # the older name
    assert [c["verdict"] for c in got["component_list"]] == [verdict]
    assert (got["faces"], got["uv"], got["uv_sets"]) == (len(shape[1]), None, [])
    assert verdict in " ".join(run("check", mesh).stdout.split())


def test_defects_are_counted(tmp_path: Path) -> None:
    p, f = shapes.fins(3)
    f = np.r_[f, f[:1], [[0, 0, 1]]]
    got = report("check", obj(tmp_path / "m.obj", (np.r_[p, [[9.0, 9, 9]]], f)))
    assert got["nonmanifold_edges"] > 0
    for name in ("duplicate_faces", "degenerate_faces", "unreferenced_vertices"):
        assert got[name] == 1


def test_what_is_required_is_there(tmp_path: Path) -> None:
    """What is missing is refused: tests/cli/test_refusals.py."""
    disk = obj(tmp_path / "disk.obj", shapes.grid(4, 4), shapes.grid(4, 4)[0][:, :2])
    torus = obj(tmp_path / "torus.obj", shapes.torus(6, 5))
    for words in (
        (disk, "--require", "disk"),
        (torus, "--fail-if", "nonmanifold_edges>0,genus>1"),
        (disk, "--uv", "--padding", "0", "--fail-if", "degraded"),
        (disk, "--uv", "--padding", "0", "--fail-if", "status!=ok"),
    ):
        assert run("check", *words, "-q").exit_code == 0


GRID = shapes.grid(5, 5)
FLAT = GRID[0][:, :2] * 0.8 + 0.1
TURNED = np.where(np.arange(25)[:, None] == 12, FLAT[0], FLAT)
# uv → what is said of them, and the gate that they miss
JUDGED = {
    "good": (FLAT, {"valid": True, "faults": [], "distortion": pytest.approx(1)}, None),
    "mirrored": (FLAT * [-1, 1] + [1, 0], {"mirrored": 1, "valid": False}, "mirrored>0"),
    "flipped": (TURNED, {"flips": int((shapes.areas(TURNED[GRID[1]]) <= 0).sum())}, "flips>0"),
    # mirrored halves over one another, whose density was that of nearly nothing
    "folded": (
        np.stack([0.1 + abs(GRID[0][:, 0] - 0.5), 0.1 + 0.5 * GRID[0][:, 1]], 1),
        {"charts": 1, "flips": 16, "overlap": 1, "density_min": pytest.approx(2048 * 0.5**0.5)},
        "overlap>0",
    ),
}


@pytest.mark.parametrize("name", JUDGED)
def test_uv_of_a_file(name: str, tmp_path: Path) -> None:
    uv, said, gate = JUDGED[name]
    mesh = obj(tmp_path / "m.obj", GRID, uv)
    got = report("check", mesh, "--uv")["uv"]
    assert {key: got[key] for key in said} == said
    if gate:
        one_line_error(run("check", mesh, "--uv", "--fail-if", gate, "-q"), 6, gate)


def test_uv_that_are_all_one_point(tmp_path: Path) -> None:
    """The table ended in an internal error, and packing printed a warning of NumPy."""
    p, f = shapes.icosphere(1)
    mesh = obj(tmp_path / "m.obj", (p, f), np.zeros((len(p), 2)))
    result = run("check", mesh, "--uv")
    assert result.exit_code == 0
    assert "80 faces flipped or without area" in " ".join(result.stdout.split())
    packed = subprocess.run(
        [sys.executable, "-m", "circparam", "pack", mesh], capture_output=True, text=True
    )
    assert packed.returncode == 5
    assert packed.stderr.count("\n") == 1


def test_padding_may_grow_with_the_page(tmp_path: Path) -> None:
    p, f = shapes.join(shapes.triangle(), shapes.triangle())
    p[3:, 0] += 3
    mesh = obj(tmp_path / "m.obj", (p, f), p[:, :2] / 4)
    for size, texels in (("512", "1"), ("4096", "8")):
        words = ("check", mesh, "--uv", "--resolution", size, "--padding")
        assert report(*words, "auto")["uv"] == report(*words, texels)["uv"]
    assert report(*words, "auto")["uv"] != report(*words, "1")["uv"]


def test_several_files_have_a_line_each(tmp_path: Path) -> None:
    """In singular and plural; an error of one does not hide the others."""
    p, f = shapes.triangle()
    one = obj(tmp_path / "one.obj", (p, f), p[:, :2])
    pair = shapes.join((p, f), (p + np.array([3, 0, 0]), f))
    two = obj(tmp_path / "two.obj", pair, pair[0][:, :2] / 4)
    torus, bad = obj(tmp_path / "torus.obj", shapes.torus(10, 8)), tmp_path / "bad.obj"
    bad.write_text("nothing")
    result = run("check", one, bad, two, "--uv")
    first, second = result.stdout.splitlines()
    assert first.startswith(f"{one}: 1 face, disk, 1 boundary, 1 chart, 0 flips, 0 overlaps")
    assert second.startswith(f"{two}: 2 faces, 2 components, 2 boundaries, 2 charts")
    one_line_error(result, 3, str(bad))
    several = run("check", one, torus, "--json").stdout.splitlines()
    assert [json.loads(line)["genus"] for line in several] == [0, 1]
    assert run("check", one, torus, "--require", "disk").exit_code == 4
    assert run("check", one, torus, "--uv").exit_code == 3  # the torus has none
