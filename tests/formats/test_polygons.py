"""Polygons and the triangles made inside them."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.formats.io import read_data
from circparam.formats.polygons import triangulate


def test_the_fan_starts_at_the_first_corner_that_fits() -> None:
    """Against the rule, spelled out corner by corner."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        n = int(rng.integers(4, 8))
        angle = np.sort(rng.random(n)) * 2 * np.pi
        radius = rng.choice([1.0, 0.3], n)
        p = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.1 * rng.random(n)], 1)
        polys = triangulate(p, np.arange(n), np.array([0, n]))
        normal = np.cross(p, np.roll(p, -1, 0)).sum(0)
        for r in range(n):
            fan = [(r, (r + k) % n, (r + k + 1) % n) for k in range(1, n - 1)]
            if all(np.cross(p[b] - p[a], p[c] - p[a]) @ normal > 0 for a, b, c in fan):
                assert polys.triangles.tolist() == [list(t) for t in fan]
                break
        else:
            area = np.cross(p[polys.triangles[:, 1]] - p[polys.triangles[:, 0]],
                            p[polys.triangles[:, 2]] - p[polys.triangles[:, 0]])  # fmt: skip
            np.testing.assert_allclose(area.sum(0), normal)


def test_a_concave_polygon_is_cut_inside() -> None:
    """An arrowhead whose first corner sees not all others: the fan starts elsewhere, areas add up."""
    arrow = b"v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\nf 2 3 4 1\n"
    mesh = read_data(arrow, format="obj").mesh
    p = mesh.points[mesh.faces]
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] / 2
    assert (area < 0).all() or (area > 0).all()
    assert abs(area.sum()) == pytest.approx(0.5)


def test_a_comb_needs_ear_clipping() -> None:
    """A polygon that no fan fits: triangles still agree with it and tile it."""
    comb = [
        (0, 0),
        (5, 0),
        (5, 2),
        (4, 2),
        (4, 1),
        (3, 1),
        (3, 2),
        (2, 2),
        (2, 1),
        (1, 1),
        (1, 2),
        (0, 2),
    ]
    text = "".join(f"v {x} {y} 0\n" for x, y in comb) + "f " + " ".join(map(str, range(1, 13)))
    mesh = read_data(text.encode(), format="obj").mesh
    p = mesh.points[mesh.faces]
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] / 2
    assert len(mesh.faces) == 10
    assert (area > 0).all()
    assert area.sum() == pytest.approx(8.0)
