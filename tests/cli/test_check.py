"""``circparam check``: topology with known answers, uv with planted faults."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from circparam.cli import cli
from tests.cli.test_unwrap import obj, one_line_error
from tests.support import shapes


def check(*args: object) -> Result:
    return CliRunner().invoke(cli, ["check", *map(str, args)])


def report(*args: object) -> dict[str, object]:
    result = check(*args, "--json")
    assert result.exit_code == 0, result.stderr
    document: dict[str, object] = json.loads(result.stdout)
    return document


KNOWN = {
    "disk": (shapes.grid(), "disk", 1, 0, 1),
    "sphere": (shapes.icosphere(1), "sphere", 2, 0, 0),
    "torus": (shapes.torus(10, 8), "genus 1, closed", 0, 1, 0),
    "two handles": (shapes.handles(2), "genus 2, closed", -2, 2, 0),
    "annulus": (shapes.annulus(), "genus 0 with 2 boundaries", 0, 0, 2),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_topology(name: str, tmp_path: Path) -> None:
    shape, verdict, euler, genus, boundaries = KNOWN[name]
    got = report(obj(tmp_path / "m.obj", shape))
    assert got["schema"] == "circparam/check/1"
    assert (got["euler"], got["genus"], got["boundaries"]) == (euler, genus, boundaries)
    assert got["borders"] == got["boundaries"]  # the older name
    assert [c["verdict"] for c in got["component_list"]] == [verdict]
    assert got["faces"] == len(shape[1])
    assert got["uv"] is None
    assert got["uv_sets"] == []
    assert verdict in " ".join(check(tmp_path / "m.obj").stdout.split())


def test_defects_are_counted(tmp_path: Path) -> None:
    p, f = shapes.fins(3)
    p = np.r_[p, [[9.0, 9, 9]]]
    f = np.r_[f, f[:1], [[0, 0, 1]]]
    got = report(obj(tmp_path / "m.obj", (p, f)))
    assert got["nonmanifold_edges"] > 0
    assert got["duplicate_faces"] == 1
    assert got["degenerate_faces"] == 1
    assert got["unreferenced_vertices"] == 1


def test_require_disk(tmp_path: Path) -> None:
    disk = obj(tmp_path / "disk.obj", shapes.grid())
    assert check(disk, "--require", "disk", "-q").exit_code == 0
    mixed = obj(tmp_path / "mixed.obj", shapes.join(shapes.grid(), shapes.torus(6, 5)))
    one_line_error(
        check(mixed, "--require", "disk", "-q"), 4, "component 1", "genus 1", "--cut disk"
    )


def with_uv(path: Path, uv: np.ndarray, shape: tuple[np.ndarray, np.ndarray]) -> Path:
    p, f = shape
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in p.tolist()]
    lines += [f"vt {u!r} {v!r}" for u, v in uv.tolist()]
    lines += ["f " + " ".join(f"{k}/{k}" for k in face) for face in (f + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_uv_of_a_file(tmp_path: Path) -> None:
    p, f = shapes.grid(6, 6)
    uv = p[:, :2] * 0.8 + 0.1
    good = report(with_uv(tmp_path / "good.obj", uv, (p, f)), "--uv")["uv"]
    assert good["valid"]
    assert good["faults"] == []
    assert good["distortion"] == pytest.approx(1)
    mirrored = report(with_uv(tmp_path / "bad.obj", uv * [-1, 1] + [1, 0], (p, f)), "--uv")["uv"]
    assert mirrored["mirrored"] == 1
    assert not mirrored["valid"]
    uv[14] = uv[0]
    flipped = report(with_uv(tmp_path / "flip.obj", uv, (p, f)), "--uv")["uv"]
    assert flipped["flips"] > 0
    path = tmp_path / "flip.obj"
    one_line_error(check(path, "--uv", "--fail-if", "flips>0", "-q"), 6, "flips>0")


def test_gates_on_the_mesh_need_no_uv_and_those_on_uv_do(tmp_path: Path) -> None:
    torus = obj(tmp_path / "torus.obj", shapes.torus(6, 5))
    assert check(torus, "--fail-if", "nonmanifold_edges>0,genus>1", "-q").exit_code == 0
    one_line_error(check(torus, "--fail-if", "genus>0", "-q"), 6, "genus>0: it is 1")
    for gate in ("degraded", "flips>0", "outside>0"):
        one_line_error(check(torus, "--fail-if", gate, "-q"), 2, "--uv")
    p, f = shapes.grid(4, 4)
    bad = with_uv(tmp_path / "bad.obj", p[:, :2] * [-1, 1] + [1, 0], (p, f))
    good = with_uv(tmp_path / "good.obj", p[:, :2], (p, f))
    for gate in ("degraded", "status!=ok"):
        one_line_error(check(bad, "--uv", "--fail-if", gate, "-q"), 6, "it is degraded")
        assert check(good, "--uv", "--padding", "0", "--fail-if", gate, "-q").exit_code == 0


def test_uv_that_leave_the_unit_square(tmp_path: Path) -> None:
    p, f = shapes.grid(4, 4)
    got = report(with_uv(tmp_path / "m.obj", p[:, :2] * 3 - 1, (p, f)), "--uv")["uv"]
    assert got["outside"] == 1
    assert got["flips"] == 0
    one_line_error(
        check(tmp_path / "m.obj", "--uv", "--fail-if", "outside>0", "-q"), 6, "outside>0"
    )


def test_no_uv(tmp_path: Path) -> None:
    mesh = obj(tmp_path / "m.obj", shapes.grid())
    one_line_error(check(mesh, "--uv"), 3, "no uv set 0")


def test_one_of_anything_is_told_so(tmp_path: Path) -> None:
    """'1 boundaries, 1 charts' was said."""
    p = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    one = with_uv(tmp_path / "one.obj", p[:, :2], (p, np.array([[0, 1, 2]])))
    two = with_uv(tmp_path / "two.obj", *pair_of_triangles())
    said = check(one, two, "--uv")
    first, second = said.stdout.splitlines()
    assert "1 face, disk, 1 boundary, 1 chart, 0 flips, 0 overlaps" in first
    assert "2 faces, 2 components, 2 boundaries, 2 charts" in second


def pair_of_triangles() -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    p = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    points = np.concatenate([p, p + np.array([3, 0, 0])])
    return points[:, :2] / 4, (points, np.arange(6).reshape(2, 3))


def test_padding_may_grow_with_the_page(tmp_path: Path) -> None:
    """The help has always said so, and 'auto' was refused."""
    mesh = with_uv(tmp_path / "m.obj", *pair_of_triangles())
    for size, texels in (("512", "1"), ("4096", "8")):
        words = ("--uv", "--resolution", size, "--padding")
        assert report(mesh, *words, "auto")["uv"] == report(mesh, *words, texels)["uv"]
    assert report(mesh, *words, "auto")["uv"] != report(mesh, *words, "1")["uv"]


def test_uv_that_are_no_numbers_name_their_file(tmp_path: Path) -> None:
    uv, shape = pair_of_triangles()
    mesh = with_uv(tmp_path / "m.obj", uv * np.nan, shape)
    one_line_error(check(mesh, "--uv"), 3, "m.obj: no face has finite uv")


def test_an_option_that_needs_uv(tmp_path: Path) -> None:
    mesh = obj(tmp_path / "m.obj", shapes.grid())
    one_line_error(check(mesh, "--padding", "2"), 2, "--uv")
    one_line_error(check(mesh, "--fail-if", "flips>0"), 2, "--uv")


def test_several_files_have_a_line_each(tmp_path: Path) -> None:
    good = obj(tmp_path / "disk.obj", shapes.grid())
    torus = obj(tmp_path / "torus.obj", shapes.torus(10, 8))
    bad = tmp_path / "bad.obj"
    bad.write_text("nothing")
    result = check(good, bad, torus)
    lines = result.stdout.splitlines()
    assert [line.split(": ")[0] for line in lines] == [str(good), str(torus)]
    assert "disk" in lines[0]
    assert "genus 1" in lines[1]
    assert result.exit_code == 3
    assert result.stderr.count("circparam: error: ") == 1
    assert str(bad) in result.stderr
    several = check(good, torus, "--json").stdout.splitlines()
    assert [json.loads(line)["genus"] for line in several] == [0, 1]
    assert check(good, torus, "--require", "disk").exit_code == 4
    one_line_error(check(good, torus, "--format", "obj"), 2, "has no effect")
    quads = obj(tmp_path / "q.obj", shapes.grid(4, 4))
    assert check(good, quads, "--uv").exit_code != 0  # they have none
