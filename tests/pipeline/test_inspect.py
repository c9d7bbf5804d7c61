"""A look at a mesh: what it is, what its uv are worth, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import Mesh, UVMap
from circparam.mesh.repair import repair
from circparam.pipeline.inspect import Inspection, inspect
from circparam.pipeline.verify import verify
from tests.support import shapes
from tests.support.command_line import obj


def test_faults_of_a_set(tmp_path: Path) -> None:
    """A layout whose border is nearer to the edge of the page than the padding."""
    p, f = shapes.grid(5, 5)
    for low, padding, faulty in ((0.1, 4, False), (0.01, 4, True), (0.01, 0, False)):
        set_0 = read(obj(tmp_path / "m.obj", (p, f), p[:, :2] * (1 - 2 * low) + low))
        found = inspect(set_0, uv_set=0, resolution=64, padding=padding)
        assert (found.uv.valid, bool(found.faults)) == (True, faulty)


def test_charts_hang_together_as_the_layout_shows_them() -> None:
    """Four sheets at one line: straight ahead lies the third, in the layout the next one."""
    n = 4
    k, t, r = (a.ravel() for a in np.meshgrid(range(4), range(n), range(3), indexing="ij"))
    angle = k * np.pi / 2
    p = np.stack([r * np.cos(angle), r * np.sin(angle), 1.0 * t], 1)
    p[r == 0, :2] = 0
    a, b = (x.ravel() for x in np.meshgrid(range(n - 1), range(2), indexing="ij"))
    i = (np.arange(4)[:, None] * 3 * n + a * 3 + b).ravel()
    f = np.concatenate([np.c_[i, i + 3, i + 1], np.c_[i + 1, i + 3, i + 4]])
    f = np.where(np.isin(f[:, :1] // (3 * n), (1, 2)), f[:, ::-1], f)  # 0 fits 1 and 2, 3 fits both
    side, page = np.where(np.isin(k, (1, 2)), 1, -1), k // 2
    uv = np.stack([r * side + 2 + 5 * page, 1.0 * t], 1) / 10 + 0.02
    mesh = Mesh(p, f)
    by_angle = verify(repair(mesh)[0], UVMap(uv, f))
    assert by_angle.numbers()["charts"] == 4
    found = inspect(from_arrays(p, f, uv=uv, uv_faces=f), uv_set=0, resolution=64, padding=0)
    assert (found.uv.numbers()["charts"], found.uv.flips, found.uv.overlap) == (2, 0, 0)
    assert found.uv.numbers()["seam_length"] == 0


def two_sided(back: np.ndarray, bare: int = 0) -> Inspection:
    """What is found of a sheet of 32 faces whose backs have uv (25, 2) of their own, but for some of them."""
    p, f = shapes.grid(5, 5)
    uv = np.r_[p[:, :2] * 0.4 + [0.03, 0.3], back]
    turned = f[:, ::-1]
    uv_faces = np.r_[f, np.where(np.arange(len(f))[:, None] < bare, -1, turned + 25)]
    document = from_arrays(p, np.r_[f, turned], uv=uv, uv_faces=uv_faces)
    return inspect(document, uv_set=0, resolution=128, padding=0)


RIGHT = shapes.grid(5, 5)[0][:, :2] * [-0.4, 0.4] + [
    0.93,
    0.3,
]  # the back as one sees it from behind


@pytest.mark.parametrize(
    ("back", "bare", "fault"),
    [
        (RIGHT, 0, ""),
        (RIGHT * [-1, 1] + [1.46, 0], 0, "chart 1 mirrored"),
        (RIGHT - [0.3, 0], 0, "charts overlapping, the first 0 and 1"),
        (np.where(np.arange(25)[:, None] == 12, RIGHT + 0.3, RIGHT), 0, "flipped"),
        (
            np.where(np.arange(25)[:, None] == 12, [np.nan, 0.5], RIGHT),
            0,
            "6 faces without finite uv",
        ),
        (np.where(np.arange(25)[:, None] == 12, np.inf, RIGHT), 0, "6 faces without finite uv"),
        (RIGHT, 3, "3 faces without finite uv"),
        (RIGHT + np.array([0.5, 0]), 0, "chart 1 outside the unit square: u from 0.03 to 1.43"),
    ],
)
def test_backs_are_faces_of_their_own(back: np.ndarray, bare: int, fault: str) -> None:
    found = two_sided(back, bare)
    assert [line for line in found.faults if fault in line] == found.faults[:1]
    assert found.uv.valid == (fault == "" or "outside" in fault)
    assert bare or not np.isfinite(back).all() or found.uv.numbers()["charts"] == 2
    assert found.shared == 0


def test_backs_that_lie_on_their_fronts_are_judged_with_them() -> None:
    """What unwrap promises of duplicates: they take the uv of the face that was kept."""
    found = two_sided(shapes.grid(5, 5)[0][:, :2] * 0.4 + [0.03, 0.3])
    assert (found.uv.valid, found.uv.numbers()["charts"], found.shared) == (True, 1, 32)
    assert any("32 faces on a face" in line for line in found.notes)


def test_faces_without_area_have_uv_too() -> None:
    """A degenerate face covers nothing that is seen, but one without uv is a face without uv."""
    p, f = shapes.grid(3, 3)
    line = np.array([[0, 1, 2]])
    uv_faces = np.r_[f, [[-1, -1, -1]]]
    found = inspect(from_arrays(p, np.r_[f, line], uv=p[:, :2], uv_faces=uv_faces), uv_set=0)
    assert (found.uv.missing, found.uv.valid) == (1, False)


@pytest.mark.parametrize(
    ("far", "pages", "outside"), [(3.0, 2, 0), (1e6, 2, 0), (1e15, 2, 0), (1e30, 2, 1)]
)
def test_empty_pages_between_cost_nothing(far: float, pages: int, outside: int) -> None:
    found = two_sided(np.round(RIGHT * 8) / 8 + [far, 0])
    n = found.uv.numbers()
    assert n["pages"] == pages
    assert n["outside"] >= outside
    if far < 1e10:
        assert n["pack"] == pytest.approx(0.16, abs=0.02)
        assert any("empty pages" in line for line in found.notes)


def test_uv_that_no_float_holds_are_none() -> None:
    found = two_sided(RIGHT * 1e300)
    assert found.uv.missing == 32
    assert any("do not fit float32" in line for line in found.notes)


def test_too_many_pages_are_told_and_not_drawn() -> None:
    p, f = shapes.row_of(shapes.grid(2, 2), 101, gap=1.0)
    found = inspect(from_arrays(p, f, uv=p[:, :2] / 2 + 0.25, uv_faces=f), uv_set=0)
    n = found.uv.numbers()
    assert (n["pages"], n["pack"], n["border_texels"]) == (101, None, None)
    assert any("101 pages" in line for line in found.faults)
