"""Crushed needles get their shape back: loads fall, nothing flips, boundaries hardly move."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.geometry.overlap import signs
from circparam.pipeline.representable_uv import FAR_ON_BOUNDARY, mend_faces
from circparam.pipeline.rounding_slivers import relieve
from tests.support.needles import ROUNDINGS, boundary_vertices

Mesh = tuple[np.ndarray, np.ndarray]
F4 = ROUNDINGS["f4"]


def fan_with_needles(rng: np.random.Generator, n: int, width: float, near: float) -> Mesh:
    """A fan of n slivers so narrow; every second has a vertex so near to its tip, relative to its length."""
    angle = rng.uniform(0, 6) + width * np.cumsum(rng.uniform(0.5, 1.5, n + 1))
    rim = 0.3 * np.stack([np.cos(angle), np.sin(angle)], 1)
    points = 0.5 + rng.uniform(-0.1, 0.1, 2) + np.r_[np.zeros((1, 2)), rim]
    faces = []
    for k in range(n):
        a, b, c = 0, k + 1, k + 2
        if k % 2:
            faces.append([a, b, c])
            continue
        new = len(points)
        inside = points[a] + near * ((points[b] - points[a]) + (points[c] - points[a]))
        points = np.r_[points, inside[None]]
        faces += [[a, b, new], [b, c, new], [c, a, new]]
    return points, np.array(faces)


def energy(faces: np.ndarray, before: np.ndarray, after: np.ndarray) -> float:
    """Mean symmetric Dirichlet energy over 4, by numpy's own inverses and singular values."""
    p, q = before[faces], after[faces]
    a = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], 2)
    b = np.stack([q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]], 2)
    s = np.linalg.svd(b @ np.linalg.inv(a), compute_uv=False)
    area = np.abs(np.linalg.det(a))
    return float(((s**2 + s**-2).sum(1) / 4 * area).sum() / area.sum())


@settings(deadline=None, max_examples=25)
@given(
    st.integers(1, 6), st.floats(-2.5, -0.5), st.floats(-8.5, -5), st.sampled_from(["f4", "glb"]),
    st.integers(0, 2**20),
)  # fmt: skip
def test_slivers_with_needles_are_upright_and_hardly_distorted(
    n: int, width: float, near: float, name: str, seed: int
) -> None:
    rounding = ROUNDINGS[name]
    p, f = fan_with_needles(np.random.default_rng(seed), n, 10**width, 10**near)
    assert (signs(p, f) > 0).all()
    boundary = boundary_vertices(f, len(p))
    mended = mend_faces(f, p, boundary, rounding)
    assert not mended.spoilt.any()
    got = relieve(f, p, mended.uv, boundary, np.zeros(len(f), np.int64), rounding)
    np.testing.assert_array_equal(rounding(got), got)
    assert (signs(got, f) > 0).all()
    # the areas of the needles themselves are known to a millionth
    assert energy(f, p, got) <= energy(f, p, mended.uv) * (1 + 1e-4)
    if width > -1 and near > -7.5:  # narrower ones have no place that is near enough
        assert energy(f, p, got) < 1.02
    away = np.abs(got - rounding(p)).max(1)
    assert away[boundary].max(initial=0.0) <= FAR_ON_BOUNDARY * 2.0**-23


def test_a_needle_left_with_a_cell_gets_its_area_back() -> None:
    p = np.array([[0.25, 0.25], [0.75, 0.25], [0.5, 0.75], [0.25 + 3e-6, 0.25 + 2e-6]])
    f = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]])
    at = F4(p)
    at[3] = np.float32(0.25) + np.array([2.0**-16, 2.0**-25])  # upright, all but flat
    assert (signs(at, f) > 0).all()
    boundary = np.array([True, True, True, False])
    got = relieve(f, p, at, boundary, np.zeros(3, np.int64), F4)
    assert energy(f, p, at) > 1.1
    assert energy(f, p, got) < 1.001


def test_what_is_not_crushed_stays_where_it_is() -> None:
    p, f = fan_with_needles(np.random.default_rng(1), 5, 0.3, 1e-2)
    got = relieve(f, p, F4(p), boundary_vertices(f, len(p)), np.zeros(len(f), np.int64), F4)
    np.testing.assert_array_equal(got, F4(p))
