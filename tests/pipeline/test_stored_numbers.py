"""Layouts in the numbers that a format stores: upright faces, no overlap, little moved, no more charts."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import Delaunay

import circparam
from circparam.formats import io
from circparam.formats.io import read, rounding
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.pipeline import stored_fit
from circparam.pipeline.fallback import SOUND
from circparam.pipeline.representable_uv import BOUNDARY_NUMBERS, RAY_NUMBERS, Patch, mend_faces
from circparam.pipeline.stored_fit import store
from tests.support import shapes
from tests.support.atlases import cut_where, surface_of
from tests.support.charts import flat_of
from tests.support.exact import exact_sign
from tests.support.shapes import areas, boundary, sheet_faces

ROUNDINGS = {
    "f4": lambda uv: uv.astype(np.float32).astype(np.float64),
    "glb": io.rounding("glb"),
    "f8": lambda uv: uv.copy(),
    "steps": lambda uv: np.round(uv * 2.0**24) / 2.0**24,
    "decimals": lambda uv: np.round(uv, 7),  # as a text of seven digits would
}


def crowd(rng: np.random.Generator, n: int, width: float):
    """A random square with n vertices within ``width`` of each other: (points (k, 2), faces), 0.1 wide."""
    q = rng.uniform(-0.5, 0.5, 2) + rng.normal(size=(n, 2)) * width / 0.05
    corners = [[-1.1, -1.1], [1.1, -1.1], [1.1, 1.1], [-1.1, 1.1]]
    p = np.concatenate([rng.uniform(-1, 1, (60, 2)), q, corners])
    return _upright(p * 0.05 + rng.uniform(0.1, 0.9, 2), Delaunay(p).simplices)


def band(rng: np.random.Generator, n: int, width: float):
    """A turned grid of n columns in which up to three rows lie only ``width`` apart: (points, faces)."""
    y = np.sort(np.r_[np.linspace(0, 1, 4), 0.5 + np.arange(rng.integers(1, 4)) * width / 0.05])
    px, py = np.meshgrid(np.linspace(0, 1, n), y)
    t = rng.uniform(0, 6)
    turn = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
    p = 0.05 * np.stack([px.ravel(), py.ravel()], 1) @ turn + rng.uniform(0.2, 0.8, 2)
    return _upright(p, sheet_faces(len(y) - 1, n - 1))


def boundary_vertices(faces, n: int):
    """(n,) bool: the vertex is on a side that one face has alone."""
    out = np.zeros(n, bool)
    out[boundary(faces)] = True
    return out


def _upright(p, f):
    area = areas(p[f])
    return p, np.where(area[:, None] < 0, f[:, [0, 2, 1]], f)[area != 0]


QUICK = {"effort": 0.01, "resolution": 64}
numbers = st.floats(-2.0, 2.0) | st.sampled_from([0.0, 0.5, 1.0, 1 - 2.0**-24, 2.0**-30])
seeds = st.integers(0, 2**20)


@given(
    st.sampled_from(["f4", "glb", "steps", "decimals"]),
    st.sampled_from([crowd, band]),
    st.integers(2, 10), st.floats(-10, -7.5), seeds,
)  # fmt: skip
def test_needles_are_upright_after_a_few_units(name, make, n: int, width: float, seed: int) -> None:
    p, f = make(np.random.default_rng(seed), n, 10.0**width)
    patch = Patch(f, p, boundary_vertices(f, len(p)), ROUNDINGS[name])
    before = signs(patch.start, f) <= 0
    uv, spoilt = mend_faces(patch)
    np.testing.assert_array_equal(patch.rounding(uv), uv)
    assert not spoilt.any()
    assert all(exact_sign(*uv[t]) > 0 for t in f[before])
    assert (signs(uv, f) > 0).all()
    away = np.abs(uv - patch.start).max(1)
    unit = 1e-7 if name == "decimals" else 2.0**-23
    assert (away <= np.where(patch.on_boundary, BOUNDARY_NUMBERS, RAY_NUMBERS[-1]) * unit).all()
    near = np.zeros(len(p), bool)
    near[f[before]] = True
    for _ in range(5):
        near[f[near[f].any(1)]] = True
    assert not away[~near].any(), "only what is near a spoilt face moves"


@pytest.mark.parametrize(
    ("count", "width", "seed", "inside"),
    [(120, 1e-9, 3, True), (120, 1e-9, 3, False), (8, 3e-8, 1, False)],
)
def test_vertices_on_a_boundary_move_little_and_others_as_far_as_they_must(
    count: int, width: float, seed: int, inside: bool
) -> None:
    """To be upright, and to get their shape back. Gaps between charts have no room for more: of 120 vertices
    within 1e-9 some faces stay spoilt there."""
    p, f = crowd(np.random.default_rng(seed), count, width)
    patch = Patch(f, p, np.full(len(p), not inside), ROUNDINGS["f4"])
    mended, spoilt = mend_faces(patch)
    uv = stored_fit.relieve(patch, mended, np.zeros(len(f), np.int64))
    away = np.abs(uv - patch.start) / np.spacing(patch.start.astype(np.float32))
    assert (0 < BOUNDARY_NUMBERS < away.max()) if inside else (0 < away.max() <= BOUNDARY_NUMBERS)
    assert bool(spoilt.any()) is (count > 100 and not inside)


def slit(n: int = 24) -> tuple[CutMesh, np.ndarray]:
    """A flat square with a slit from its middle to one side, whose sides rounding makes cross."""
    p, f = shapes.grid(n, n)
    surface = surface_of(p, f)
    row = np.unique(p[:, 1])[n // 2]
    cut_mesh = surface.cut_mesh(cut_where(surface, (p[:, 1] == row) & (p[:, 0] >= 0.5)))
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()] = p[surface.faces.ravel(), :2]
    above = np.zeros(cut_mesh.n_vertices, bool)
    above[cut_mesh.faces[uv[cut_mesh.faces].mean(1)[:, 1] > row]] = True
    side = above & (uv[:, 1] == row) & (uv[:, 0] > 0.55)
    uv += side[:, None] * [0.4 / n, 1e-10]  # its vertices lie between those of the other side
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    return cut_mesh, 0.5 * uv @ turn + [0.3, 0.1]


@pytest.mark.parametrize("name", ["f4", "glb", "steps"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_sides_of_a_slit_that_rounding_crosses_draw_back(name: str, mirrored: bool) -> None:
    cut_mesh, uv = slit()
    uv, number = (uv * [-1, 1] + [1, 0] if mirrored else uv), ROUNDINGS[name]
    assert overlaps(cut_mesh, number(uv)).crossings.size
    got = store(cut_mesh, uv, np.array([mirrored]), number)
    assert got.sound
    found = overlaps(cut_mesh, got.uv)
    assert not found.self_overlapping.any()
    assert (signs(got.uv, cut_mesh.faces) == (-1 if mirrored else 1)).all()
    np.testing.assert_array_equal(number(got.uv), got.uv)
    assert 0 < got.moved < 40
    assert np.abs(got.uv - uv).max() < 7 * 2.0**-23


def test_what_overlaps_widely_is_told_not_mended() -> None:
    cut_mesh, uv = slit()
    polar = uv - uv.mean(0)
    radius, angle = np.linalg.norm(polar, axis=1), np.arctan2(polar[:, 1], polar[:, 0])
    angle += 25.0 * (1 - radius / radius.max())  # wound up: the slit's sides cut through each other
    wound = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
    assert store(cut_mesh, wound, np.array([False]), ROUNDINGS["f4"]).fault.tolist() != [SOUND]


def test_a_turn_of_the_pages_takes_charts_to_finer_numbers() -> None:
    """A chart 1e-8 of a page wide at the bottom left: v of glTF is finest at the top. Each keeps its page.

    It has more spoilt faces than are searched for places.
    """
    cut_mesh, uv = flat_of(shapes.row_of(shapes.delaunay_disk(700, 1), 2))
    first = cut_mesh.vertex_chart == 0
    uv[first] = 5e-9 * (uv[first] - uv[first].min(0)) + 1e-5
    uv[~first] = 0.3 * (uv[~first] - uv[~first].min(0)) + [1.2, 0.1]

    class Target:
        format = "glb"

        def rounding(self, double: bool = False):
            return rounding("glb", None, double)

    still = stored_fit.stored_layout(Target(), cut_mesh, uv, np.zeros(2, bool))
    turned = stored_fit.stored_layout(Target(), cut_mesh, uv, np.zeros(2, bool), turn=True)
    assert (still.sound, turned.sound) == (False, True)
    expected = np.stack([uv[:, 1] + ~first, 1 - (uv[:, 0] - ~first)], 1)
    np.testing.assert_allclose(turned.uv, expected, rtol=0, atol=1e-7)


def planted(n: int = 8, seed: int = 3) -> Surface:
    """A flat square, 0.1 wide, in which n vertices lie within 1e-9 of each other, as a mesh."""
    p, f = crowd(np.random.default_rng(seed), n, 1e-9)
    return np.c_[p - p.mean(0), np.zeros(len(p))], f


@pytest.mark.parametrize("ending", ["ply", "glb", "obj"])
@pytest.mark.parametrize("seed", [3, 4])
def test_planted_needles_cost_no_chart(tmp_path: Path, ending: str, seed: int) -> None:
    result = circparam.unwrap(planted(seed=seed), tmp_path / f"o.{ending}", **QUICK)
    assert (result.measures["charts"], result.status) == (1, "ok")
    back = read(tmp_path / f"o.{ending}").uv()
    assert (signs(back.uv, back.uv_faces) > 0).all()
    exact = circparam.unwrap(planted(seed=seed), format="obj", **QUICK)
    if (signs(rounding(ending)(exact.uv), exact.uv_faces) <= 0).any():
        assert any("nearby storable numbers" in note for note in result.notes)
    again = circparam.repack(tmp_path / f"o.{ending}", tmp_path / "p.glb", resolution=64)
    assert (again.measures["charts"], again.verification.valid) == (1, True)


@pytest.mark.parametrize(("where", "name"), [("vertex", b"double s"), ("face", b"double texcoord")])
def test_where_single_precision_has_no_place_ply_takes_doubles(where, name, tmp_path):
    """A fan whose border has more vertices within 1e-8 than storable places that a border may take."""
    y = np.r_[-0.05, np.arange(150) * 6e-11, 0.05]
    p = np.r_[[[-0.05, 0, 0]], np.stack([np.full(len(y), 0.05), y, 0 * y], 1)]
    k = np.arange(1, len(p) - 1)
    fan, path = (p, np.stack([0 * k, k, k + 1], 1)), tmp_path / "o.ply"
    result = circparam.unwrap(fan, path, ply_uv=where, **QUICK)
    assert (result.measures["charts"], result.verification.valid) == (1, True)
    assert result.uv_double
    assert (result.uv.astype(np.float32) != result.uv).any()
    assert name in path.read_bytes()[:400]
    assert any("doubles" in note for note in result.notes)


def test_needles_that_no_stored_number_holds_end_without_a_flip(tmp_path: Path) -> None:
    """Faces that differ in size by 1e12, 1e-11 thin: a triangle stands in for each, and it is large enough."""
    at = 0.37957113403931
    x = [0, 0.5, 1, 1, at + 1.3e-14, at + 8e-15, at + 3e-15, at + 3e-15]
    x += [0.6430306723995923, at + 5e-15, 0.4569060321995523, at + 6e-15, 0.7155932782944245]
    y = [0, 0, 0, 5, *[5.476844597344704] * 3, 5.4768445973446536, 3.406380391058848]
    y += [5.4768445973446316, 3.111924960843914, 5.476844597344659, 5.356314968091522]
    p = np.stack([x, 1e-11 * np.array(y), np.zeros(13)], 1)
    f = np.array([
        [11, 5, 6], [7, 11, 6], [12, 5, 11], [12, 3, 4], [5, 12, 4], [7, 9, 11], [9, 10, 11], [9, 7, 0],
        [1, 9, 0], [10, 9, 1], [10, 8, 11], [8, 12, 11], [8, 1, 2], [8, 10, 1], [3, 8, 2], [12, 8, 3],
    ])  # fmt: skip
    result = circparam.unwrap((p, f), tmp_path / "o.ply", resolution=64, effort=0.0)
    assert (result.measures["flips"], result.measures["overlap"]) == (0, 0)
    assert result.status == "degraded", "their shape is lost, and that is said"


@pytest.mark.parametrize("turned", [0, 1])
@pytest.mark.parametrize("height", [1.0, 1.0 - 1e-15, 1.0 + 1e-15])
def test_a_chart_lies_as_its_first_face_where_both_sides_are_as_large(turned, height):
    p = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, height, 0]])
    f = np.array([[0, 1, 2], [0, 2, 3]])
    f[turned] = f[turned][::-1]
    result = circparam.unwrap((p, f), **QUICK)
    first = int(result.surface.source[0])  # by position: the order of the file does not matter
    a, b, c = result.uv[result.uv_faces[first]]
    assert result.measures["mirrored"] == 0
    assert np.linalg.det([b - a, c - a]) > 0
