"""Polygons and the triangles made inside them."""

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, NoResultError
from circparam.formats import polygons
from circparam.formats.io import read_data
from circparam.formats.polygons import Ears, triangulate
from circparam.mesh.mesh import UVMap
from circparam.mesh.repair import repair
from tests.support.formats_tools import refused


def cut(p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles of one polygon (n, 3), their normals, and the polygon's, twice the areas long."""
    t = triangulate(p, np.arange(len(p)), np.array([0, len(p)])).triangles
    normals = np.cross(p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]])
    return t, normals, np.cross(p, np.roll(p, -1, 0)).sum(0)


def star(n: int) -> np.ndarray:
    """(n, 2) corners, every other one near the middle: no fan fits."""
    a = np.arange(n) * 2 * np.pi / n
    r = np.where(np.arange(n) % 2, 0.2, 1.0)
    return np.stack([r * np.cos(a), r * np.sin(a)], 1)


def test_the_fan_starts_at_the_first_corner_that_fits() -> None:
    """Against the rule, spelled out corner by corner."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        n = int(rng.integers(4, 8))
        angle = np.sort(rng.random(n)) * 2 * np.pi
        radius = rng.choice([1.0, 0.3], n)
        p = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.1 * rng.random(n)], 1)
        triangles, normals, normal = cut(p)
        for r in range(n):
            fan = [(r, (r + k) % n, (r + k + 1) % n) for k in range(1, n - 1)]
            if all(np.cross(p[b] - p[a], p[c] - p[a]) @ normal > 0 for a, b, c in fan):
                assert triangles.tolist() == [list(t) for t in fan]
                break
        else:
            np.testing.assert_allclose(normals.sum(0), normal)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("reverse", [False, True])
def test_concave_polygons_in_every_plane(axis: int, reverse: bool) -> None:
    """A star that no fan fits: triangles agree with its normal and tile it."""
    p = np.insert(star(10), axis, 0.5, axis=1)
    t, normals, normal = cut(p[::-1] if reverse else p)
    assert t.shape == (8, 3)
    assert (normals @ normal > 0).all()
    size = np.linalg.norm(normals, axis=1).sum() / 2
    assert size == pytest.approx(10 * 0.5 * 0.2 * np.sin(np.pi / 5))


@pytest.mark.parametrize("holes", [1, 2, 3])
def test_a_polygon_comes_back_along_the_bridges_to_its_holes(holes: int) -> None:
    """Round holes in a disk, each reached along a bridge that the outline runs twice: its triangles all turn
    as it does and their areas are what the disk has without its holes."""
    rng = np.random.default_rng(holes)
    for _ in range(20):
        outline = _ring(int(rng.integers(8, 14)), 4.0, 0.0)
        for k in range(holes):
            hole = _ring(int(rng.integers(3, 9)), 0.5, 2 * np.pi * (k + 0.3) / holes)[::-1]
            far = ((outline[:, None] - hole[None]) ** 2).sum(2)
            i, j = np.unravel_index(np.argmin(far), far.shape)
            hole = np.roll(hole, -j, 0)
            outline = np.concatenate([outline[: i + 1], hole, hole[:1], outline[i:]])
        p = np.c_[outline, np.zeros(len(outline))]
        triangles, normals, normal = cut(p)
        assert (normals[:, 2] > -2e-12).all()
        np.testing.assert_allclose(normals.sum(0), normal)
        # none lies in a hole
        centre = p[triangles].mean(1)[:, :2]
        for k in range(holes):
            middle = _ring(1, 0.0, 2 * np.pi * (k + 0.3) / holes)
            assert (((centre - middle) ** 2).sum(1) > 0.5**2 / 16).all()


def _ring(n: int, radius: float, turn: float) -> np.ndarray:
    """(n, 2) corners of a regular polygon: about the origin, or, if small, at 2 from it."""
    angle = 2 * np.pi * np.arange(n) / n
    middle = 2.0 * np.array([np.cos(turn), np.sin(turn)]) if radius < 1 else np.zeros(2)
    return middle + radius * np.stack([np.cos(angle), np.sin(angle)], 1)


@pytest.mark.parametrize(
    ("face", "kept"),
    [
        ("1 2 3 4" + " 1 2 3 4" * 99 + " 1", 2),
        ("5 4 2 5 4 1 2 5 1 4 2 1", 0),
    ],
    ids=["laps", "tetrahedron"],
)
def test_a_polygon_that_closes_round_nothing_refuses_no_file(face: str, kept: int) -> None:
    """A square that goes round a hundred times is one square; a closed polygon is set aside."""
    points = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 5 0 0\nv 6 0 0\nv 5 1 0\n"
    data = points + f"f {face}\nf 6 7 8\n".encode()
    surface, _ = repair(read_data(data, format="obj").mesh)
    assert len(surface.faces) == kept + 1
    result = circparam.unwrap(read_data(data, format="obj"), effort="draft")
    assert (result.status, result.verification.missing) == ("repaired", 0)


POINTS = "0 0, 4 0, 4 4, 0 4, 1 1, 1 3, 3 3, 3 1, 8 4, 8 8, 4 8, 8 0"
RETURNS = {
    "spike": ("1 2 12 2 3 4", 16),
    "spike on a spike": ("1 2 12 9 12 2 3 4", 16),
    "spike at the first corner": ("12 2 3 4 1 2", 16),
    "two squares": ("3 9 10 11 3 4 1 2", 32),
    "two triangles": ("1 2 3 10 11 3", 16),
    "crossing": ("1 2 3 11 10 3", 16),
    "hole": ("1 2 3 4 1 5 6 7 8 5", 12),
    "hole and spike": ("1 2 12 2 3 4 1 5 6 7 8 5", 12),
    "every corner twice": ("1 1 2 2 3 3 4 4", 16),
    "two rounds": ("1 2 3 4 1 2 3 4", 32),
}


@pytest.mark.parametrize("kind", RETURNS)
def test_a_polygon_that_comes_back_to_a_point_keeps_its_uv_whole(kind: str) -> None:
    """Its triangles cover its area, all corners have uv, and the result has no flip and no overlap."""
    face, area = RETURNS[kind]
    xy = [row.split() for row in POINTS.split(", ")]
    lines = [*(f"v {x} {y} 0" for x, y in xy), "v 0 0 5", "v 4 0 5", f"f {face}", "f 1 13 14 2"]
    document = read_data("\n".join(lines).encode() + b"\n", format="obj")
    p = document.mesh.points[document.mesh.faces[document.polygons().owner == 0]]
    areas = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] / 2
    assert np.abs(areas).sum() == pytest.approx(area)
    assert (areas >= 0).all() or kind == "crossing"
    result = circparam.unwrap(document, effort="draft")
    assert result.status in ("ok", "repaired")
    assert (result.verification.flips, result.verification.missing) == (0, 0)
    corners = document.polygons().corner_uv(UVMap(result.uv, result.uv_faces), kind)
    assert (corners >= 0).all()


def test_large_concave_polygons_are_refused() -> None:
    n = polygons.MAX_CONCAVE_CORNERS + 2
    p = np.c_[star(n), np.zeros(n)]
    with pytest.raises(InputError, match=f"polygon 0 is concave and has {n} corners"):
        cut(p)
    assert len(cut(p[:10])[0]) == 8


def quad(uv: np.ndarray, faces: list[list[int]]) -> np.ndarray:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    polys = triangulate(points, np.arange(4), np.array([0, 4]))
    return polys.corner_uv(UVMap(uv, np.array(faces)), "it")


def test_triangles_of_a_polygon_agree_at_its_corners() -> None:
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [1, 1], [0.5, 1]])
    assert quad(uv, [[0, 1, 2], [0, 2, 3]]).tolist() == [0, 1, 2, 3]
    assert quad(uv, [[0, 1, 2], [0, 4, 3]]).tolist() == [0, 1, 2, 3]  # equal numbers
    first = np.concatenate([uv, uv[:2]])  # rows 6 and 7 hold the numbers of 0 and 1
    assert quad(first, [[0, 1, 2], [6, 2, 3]]).tolist() == [0, 1, 2, 3]
    with pytest.raises(NoResultError, match="two uv"):
        quad(first, [[0, 1, 2], [7, 2, 3]])
    assert quad(uv, [[-1, -1, -1], [-1, -1, -1]]).tolist() == [-1] * 4
    for wrong in ([0, 5, 3], [0, -1, 3], [0, 1, 3]):
        with pytest.raises(NoResultError, match="it: polygon 0 got two uv"):
            quad(uv, [[0, 1, 2], wrong])
    with pytest.raises(NoResultError, match="two uv"):  # none is not the uv 0, 0
        quad(uv, [[0, 1, 2], [-1, 2, 3]])


def long_comb(n: int) -> np.ndarray:
    """(2 n + 2, 3) a comb of n teeth, none of whose corners sees all others, along no axis."""
    x = np.arange(n)
    teeth = np.stack([[x, np.full(n, 3.0)], [x + 0.5, np.ones(n)]], 0).transpose(2, 0, 1)
    flat = np.concatenate([teeth.reshape(-1, 2), [[n, 0.0], [0.0, 0.0]]])[::-1]
    return flat @ np.array([[0.6, 0.8, 0.0], [-0.48, 0.36, 0.8]])


@pytest.mark.parametrize("straight", [False, True], ids=["comb", "sides of many corners"])
def test_large_polygons_take_time_by_their_corners(straight: bool) -> None:
    """Corners near triangles are counted, and nothing is timed: four times the corners take
    less than eight times the work."""
    looked = []
    for n in (250, 1000):
        p = long_comb(n)
        if straight:
            k = np.linspace(0, 4, 2 * n + 2, endpoint=False)
            square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], float)
            p = np.stack([*(np.interp(k, np.arange(5), c) for c in square.T), 0 * k], 1)
        count = len(p)
        _, normals, normal = cut(p)
        assert (normals @ normal >= -1e-9 * normal @ normal / count).all()
        np.testing.assert_allclose(normals.sum(0), normal, atol=1e-9 * np.abs(normal).max())
        ears = Ears(p[:, :2] - p[0, :2])
        assert len(ears.clip()) == count - 2
        looked.append(ears.looked)
    assert looked[1] < 8 * looked[0]


def test_thousands_of_spikes_are_tiled_or_refused_in_bounded_work(monkeypatch) -> None:
    rng = np.random.default_rng(0)
    angle, radius = np.sort(rng.random(2000)) * 2 * np.pi, 0.2 + rng.random(2000)
    star = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
    triangles, normals, normal = cut(star)
    assert len(triangles) == 1998
    assert (normals @ normal > 0).all()
    np.testing.assert_allclose(normals.sum(0), normal, atol=1e-12)
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in star.tolist())
    text += "f " + " ".join(str(k + 1) for k in range(2000)) + "\n"
    monkeypatch.setattr("circparam.formats.polygons.MAX_LOOKED_CORNERS", 10_000)
    refused(text.encode(), "too intricate: triangulate it first", "obj")
