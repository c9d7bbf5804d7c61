"""Maps chart on chart: layouts whose charts correspond, and what is told where they do not."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import TopologyError
from circparam.mesh.mesh import Mesh, UVMap
from tests.support import pairs, shapes, tori
from tests.support.baking import stored


@pytest.mark.parametrize("relax", [True, False])
def test_charts_go_to_charts(tmp_path: Path, relax: bool) -> None:
    one, two = tori.patchwork(24, 12, 4, 3), tori.patchwork(32, 18, 4, 3, bump=0.2)
    a, b = (stored(tmp_path, n, *x) for n, x in (("a", one), ("b", two)))
    at, goals = [tori.angles(m.mesh.points) for m in (a, b)], ([0.3, 0.3], [1.9, 2.4])
    marks = np.array([[np.linalg.norm(x - g, axis=1).argmin() for x in at] for g in goals])
    found = circparam.map_surfaces(a, b, landmarks=marks, charts=True, relax=relax)
    assert found.inversions == (0, 0)
    assert found.landmark_error == 0
    image = found.map.to_b.of(b.mesh.points, b.mesh.faces)
    assert np.isclose(tori.turns(image, a.mesh.faces).sum(), 1)
    # how far into the charts, 4 along and 3 around, places lie
    own, there = (
        tori.angles(p) % (2 * np.pi) / (2 * np.pi) * [4, 3] for p in (a.mesh.points, image)
    )
    if not relax:  # every vertex stays in its chart, those on seams on theirs
        inside = (np.abs(own - np.round(own)) > 1e-6).all(1)
        assert inside.sum() > 100
        gap = (there - np.floor(own) + [2, 1.5]) % [4, 3] - [2, 1.5]
        assert gap[inside].min() > -0.05
        assert gap[inside].max() < 1.05
    far = (there - own + [2, 1.5]) % [4, 3] - [2, 1.5]
    assert np.abs(far).max() < 0.6


def test_a_disk_in_two_charts(tmp_path: Path) -> None:
    both = []
    for name, n in (("a", 12), ("b", 17)):
        p, f = shapes.grid(n + 1, n + 1)
        p[:, :2] /= p[:, :2].max()
        chart = (p[f][:, :, 0].mean(1) > (n // 2) / n).astype(int)
        uv = p[f][:, :, :2] + 3 * chart[:, None, None]
        layout = UVMap(uv.reshape(-1, 2), np.arange(f.size).reshape(-1, 3))
        both.append(stored(tmp_path, name, Mesh(p, f), layout))
    a, b = both
    marks = np.stack([pairs.nearest(m.mesh, np.array([[0.25, 0.3, 0]])) for m in both], 1)
    found = circparam.map_surfaces(a, b, charts=True, landmarks=marks, relax=False)
    assert found.inversions == (0, 0)
    image = found.map.to_b.of(b.mesh.points, b.mesh.faces)
    on_seam = np.abs(a.mesh.points[:, 0] - 0.5) < 1e-9
    assert on_seam.sum() > 10
    np.testing.assert_allclose(image[on_seam, 0], 8 / 17, atol=1e-9)


@pytest.mark.parametrize(
    ("first", "second", "says"),
    [
        ((4, 3), (3, 3), r"a\.obj has 12 charts, 24 seams and 12 nodes, .*b\.obj has 9 charts"),
        ((3, 1), (3, 1), "closed loop that meets no other"),
        ((), (), "no seam"),
    ],
)
def test_layouts_without_charts_that_correspond(first, second, says, tmp_path: Path) -> None:
    """The numbers of charts along the torus and round its tube; none is one chart that covers itself."""
    mesh = tori.torus(24, 12)
    plain = mesh, UVMap(mesh.points[:, :2].copy(), mesh.faces)
    made = [tori.patchwork(24, 12, *counts) if counts else plain for counts in (first, second)]
    a, b = (stored(tmp_path, name, *one) for name, one in zip("ab", made, strict=True))
    with pytest.raises(TopologyError, match=says):
        circparam.map_surfaces(a, b, charts=True)
