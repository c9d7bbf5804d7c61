"""Verification finds every planted fault, and trusts nothing but the layout it is given."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, OutOfTimeError
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.mesh import Mesh, UVMap
from circparam.mesh.repair import RepairOptions, repair
from circparam.mesh.surface import Surface
from circparam.pipeline.gates import LAYOUT
from circparam.pipeline.options import Options
from circparam.pipeline.result import Result, promise, verify_layout, with_status
from circparam.pipeline.save import export_seams, seam_pairs
from circparam.pipeline.verify import Promise, reasons, verify
from tests.support import shapes
from tests.support.unwrapped import QUICK, unwrapped


def two_squares() -> tuple[Surface, np.ndarray, np.ndarray]:
    """Two flat squares, and a layout that is right: side by side in the unit square."""
    p, f = shapes.row_of(shapes.grid(5, 5), 2, gap=0.25)
    uv = p[:, :2] * 0.4 + [0.03, 0.3]
    surface, _ = repair(Mesh(p, f), RepairOptions())
    return surface, uv, f


def test_a_right_layout_has_no_fault() -> None:
    surface, uv, f = two_squares()
    v = verify(surface, UVMap(uv, f), resolution=256, padding=4)
    assert v.valid
    assert reasons(v, Promise(1.001, 4)) == []
    n = v.numbers()
    assert (n["charts"], n["flips"], n["overlap"], n["mirrored"], n["missing"]) == (2, 0, 0, 0, 0)
    assert n["distortion"] == pytest.approx(1)
    assert n["seam_length"] == 0
    assert n["pack"] == pytest.approx(0.32, abs=0.01)
    assert set(n) <= set(LAYOUT)


def touching(uv: np.ndarray) -> None:
    """Charts that share a side of the plane do not overlap: seen on the raster only."""
    uv[25:] -= [uv[25, 0] - uv[:25, 0].max(), 0]


def flattened(uv: np.ndarray) -> None:
    uv[25:] = (uv[25:] - uv[25]) * [1, 0.5] + uv[25]


def mirrored(uv: np.ndarray) -> None:
    uv[25:, 0] = 1.5 - uv[25:, 0]


def moved(far: float) -> Callable[[np.ndarray], object]:
    return lambda uv: np.subtract(uv, [far, 0], out=uv)


@pytest.mark.parametrize(
    ("spoil", "promised", "said"),
    [
        (mirrored, Promise(), ["chart 1 mirrored"]),
        (touching, Promise(None, 2), ["texels apart"]),
        (moved(0.03), Promise(None, 4), ["at the border"]),
        (moved(0.1), Promise(None, 4), ["outside", "at the border"]),
        (flattened, Promise(1.05), ["above the bound 1.05"]),
        (flattened, Promise(None), []),
    ],
)
def test_a_planted_fault_is_named_and_no_other(spoil, promised, said):
    surface, uv, f = two_squares()
    spoil(uv)
    v = verify(surface, UVMap(uv, f), resolution=256, padding=4)
    found = reasons(v, promised)
    assert len(found) == len(said), found
    assert all(word in line for word, line in zip(said, found, strict=True))
    assert (v.charts, v.flips, v.overlap) == (2, 0, 0)


def test_one_turned_face_is_one_flip() -> None:
    surface, uv, f = two_squares()
    uv[6] += 0.12  # an inner vertex of the first square, pulled over the next one
    v = verify(surface, UVMap(uv, f))
    assert v.flips == (shapes.areas(uv[f]) <= 0).sum() > 0
    assert any("flipped" in line and "chart 0" in line for line in reasons(v, Promise()))


def test_a_gap_along_the_diagonal_is_found() -> None:
    """Texels whose centres are 3 and 3 apart have 3.24 between them, at a padding of 4."""
    p, f = shapes.row_of(shapes.grid(2, 2), 2, gap=0.25)
    surface, _ = repair(Mesh(p, f), RepairOptions())
    side = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    uv = np.concatenate([side * 20 + 16, side * 20 + 16 + 20 + 2]) / 64
    v = verify(surface, UVMap(uv, f), resolution=64, padding=4)
    assert v.numbers()["gap_texels"] == pytest.approx(np.hypot(3, 3))
    assert any("3.2 texels apart" in line for line in reasons(v, Promise(None, 4)))


def test_atlases_of_different_density_are_each_at_their_own_best_scale() -> None:
    surface, uv, f = two_squares()
    uv[25:] = (uv[25:] - uv[25]) / 7 + uv[25]
    tiles = (np.arange(len(f)) >= len(f) // 2).astype(int)
    together, apart = verify(surface, UVMap(uv, f)), verify(surface, UVMap(uv, f), tiles=tiles)
    assert apart.measures.sd == pytest.approx(1)
    assert together.measures.sd > 1.5


def test_the_stretch_that_was_asked_for_holds_but_for_a_thousandth() -> None:
    surface, uv, f = two_squares()
    inner = np.flatnonzero((np.abs(uv - uv[:25].mean(0)) < 1e-9).all(1))[0]
    uv[inner] += 0.6 * (uv[inner + 1] - uv[inner])
    v = verify(surface, UVMap(uv, f))
    n = v.numbers()
    worst = v.measures.tail.stretch[-1]
    assert n["share_over_2"] == v.measures.tail.share_over(2.0)
    assert 1 < n["stretch_p95"] <= n["stretch_p99"] <= n["stretch_p999"] == worst
    assert worst > 1.5
    assert reasons(v, Promise(stretch=worst * 1.01)) == []
    (line,) = reasons(v, Promise(stretch=worst * 0.99))
    assert "the limit is 0.1 %" in line
    assert reasons(v, Promise()) == []


def test_faces_without_uv() -> None:
    surface, uv, f = two_squares()
    g = f.copy()
    g[:3] = -1
    v = verify(surface, UVMap(uv, g))
    assert v.missing == 3
    assert v.flips == 0
    with pytest.raises(InputError, match="no face has finite uv"):
        verify(surface, UVMap(np.zeros((0, 2)), np.full_like(f, -1)))


def one_side_turned() -> shapes.Shape:
    """A cube with the faces of one side wound the other way: turned for the solve, but not in the file."""
    p, f = shapes.cube(2)
    side = (p[f][:, :, 2] == p[:, 2].max()).all(1)
    return p, np.where(side[:, None], f[:, [0, 2, 1]], f)


@pytest.mark.parametrize("shape", [shapes.moebius(16, 2), shapes.klein(16, 8), one_side_turned()])
def test_seams_are_the_edges_whose_faces_differ_in_uv(shape: shapes.Shape, tmp_path: Path) -> None:
    """By hand, edge by edge: as measured, as pairs of vertices of the input, and as exported."""
    p, f = shape
    result = circparam.unwrap((p, f), sharp=60, effort=0.01)
    assert result.verification.valid
    assert result.measures["mirrored"] == 0
    assert result.measures["distortion_max_chart"] <= 1.05 * (1 + 1e-4)
    assert not not_disks(result.verification.cut_mesh).any()
    at: dict[tuple[int, int], list[dict[int, int]]] = {}
    for face, uv in zip(f.tolist(), result.uv_faces.tolist(), strict=True):
        for k in range(3):
            side = {face[k]: uv[k], face[(k + 1) % 3]: uv[(k + 1) % 3]}
            at.setdefault((min(side), max(side)), []).append(side)
    cut = [edge for edge, sides in sorted(at.items()) if sides[0] != sides[-1]]
    assert seam_pairs(result).tolist() == [list(edge) for edge in cut] != []
    a, b = np.array(cut).T
    length = np.linalg.norm(p[a] - p[b], axis=1).sum() / np.sqrt(shapes.areas(p[f]).sum())
    assert result.measures["seam_length"] == pytest.approx(length)
    export_seams(result, tmp_path / "s.txt")
    exported = np.loadtxt(tmp_path / "s.txt", int)
    np.testing.assert_array_equal(exported, seam_pairs(result))
    assert circparam.unwrap((p, f), seams=exported, effort=0.01).measures["flips"] == 0


def judgement(
    scale: object, repairs: list[str], expired: bool = False, **options: object
) -> Result:
    """That on a flat square whose uv are its points, stretched."""
    points, faces = shapes.grid(4, 4)
    made = unwrapped((points, faces), **QUICK)
    uvmap, asked = UVMap(0.1 + 0.8 * points[:, :2] * scale, faces), Options(**options)
    found = verify_layout(replace(made, options=asked), uvmap)
    return with_status(replace(made, options=asked, repairs=repairs, verification=found), expired)


def test_right_repaired_and_wrong() -> None:
    assert judgement(1.0, []).status == "ok"
    mended = judgement(1.0, ["one thing"])
    assert (mended.status, mended.reasons, mended.warnings) == ("repaired", ["one thing"], [])
    stretched = judgement([1.0, 0.2], [], max_distortion=1.05)
    assert stretched.status == "degraded"
    assert stretched.reasons == stretched.warnings
    assert "above the bound 1.05" in stretched.reasons[0]


def test_out_of_time_with_and_without_a_valid_layout() -> None:
    late = judgement(1.0, [], expired=True)
    assert late.status == "ok"
    assert any("out of time" in line for line in late.warnings)
    with pytest.raises(OutOfTimeError, match="no valid result"):
        judgement([1.0, 0.0], [], expired=True)


def test_the_promise_is_that_of_the_options() -> None:
    assert promise(Options()).padding == promise(Options(padding=4)).padding
    assert promise(Options(padding=9)).padding == 9
    assert promise(Options(normalize=False)).padding is None
