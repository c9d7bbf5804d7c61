"""Room on pages in use: charts go where nothing lies, with the gap between them, or are refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from circparam.packing.options import PackOptions
from circparam.packing.room import by_page, find_room, free_share
from tests.support.packing import rectangles

ASKED = PackOptions(resolution=256, padding=4)


def page(*used: tuple[float, float, float, float]) -> np.ndarray:
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    quads = [corner * [width, height] + [u, v] for u, v, width, height in used]
    return np.array(quads)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 2)


def dense(rectangle: np.ndarray, count: int = 60) -> np.ndarray:
    """Points all over the box of some points."""
    t = np.linspace(0, 1, count)
    low, high = rectangle.min(0), rectangle.max(0)
    return low + np.stack(np.meshgrid(t, t), -1).reshape(-1, 2) * (high - low)


@pytest.mark.parametrize("rotate", ["free", "90", "none"])
def test_the_gap_stays_round_every_chart(rotate: str) -> None:
    used = page((0, 0, 1, 0.4), (0.6, 0.5, 0.1, 0.3))
    shapes = rectangles([(0.3, 0.2), (0.2, 0.35), (0.25, 0.25)])
    asked = PackOptions(resolution=256, padding=4, rotate=rotate)
    found = find_room(shapes, [used], asked, exact=True)
    assert found.scale == 1.0
    charts = [found.uv[4 * k : 4 * k + 4] for k in range(3)]
    for k, chart in enumerate(charts):
        size = np.sort(np.ptp(chart, axis=0))
        assert size == pytest.approx(np.sort(np.ptp(shapes.points[4 * k : 4 * k + 4], axis=0)))
        assert chart.min() >= asked.border / 256
        assert chart.max() <= 1 - asked.border / 256
    placed = [dense(used[:2].reshape(-1, 2)), dense(used[2:].reshape(-1, 2)), *map(dense, charts)]
    for i, a in enumerate(placed):
        for b in placed[max(i + 1, 2) :]:
            assert cKDTree(a).query(b)[0].min() >= asked.gap / 256


def test_charts_shrink_alike_or_are_refused() -> None:
    used = page((0, 0, 1, 0.75))
    shapes = rectangles([(0.5, 0.5), (0.1, 0.1)])
    assert find_room(shapes, [used], ASKED, exact=True) is None
    found = find_room(shapes, [used], ASKED, exact=False)
    assert 0.35 < found.scale < 0.5
    assert np.ptp(found.uv[:4], axis=0) == pytest.approx([0.5 * found.scale] * 2)
    assert np.ptp(found.uv[4:], axis=0) == pytest.approx([0.1 * found.scale] * 2)
    assert find_room(shapes, [page((0, 0, 1, 1))], ASKED, exact=False) is None


def test_a_second_page_takes_what_the_first_has_no_room_for() -> None:
    pages = [page((0, 0, 1, 1)), page((0, 0, 0.5, 1))]
    found = find_room(rectangles([(0.4, 0.4)]), pages, ASKED, True)
    assert found.page.tolist() == [1]
    assert 1.5 < found.uv[:, 0].min() <= found.uv[:, 0].max() < 2


def test_many_small_charts_find_room() -> None:
    shapes = rectangles([(0.03, 0.05)] * 150)
    found = find_room(shapes, [page((0, 0, 1, 0.5))], PackOptions(resolution=256, padding=1), True)
    low = found.uv.reshape(150, 4, 2).min(1)
    assert found.uv[:, 1].min() > 0.5
    assert cKDTree(low).query(low, 2)[0][:, 1].min() > 0.03


def test_what_is_free_is_told_in_pages() -> None:
    """Triangles count on the page on which they lie; a page between them may be empty."""
    used = by_page(page((2, 0, 0.25, 1), (0, 0, 1, 0.5)))
    assert [len(triangles) for triangles in used] == [2, 0, 2]
    assert free_share(used, ASKED) == pytest.approx(2.25, abs=0.02)
