"""Masks of charts: they cover what the grown chart covers, and hardly more."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.nest.masks import chart_masks

L_SHAPE = np.array([[0.0, 0], [9, 0], [9, 3], [3, 3], [3, 8], [0, 8]]) - [4.5, 4]


def masks(points, angle, grow):
    return chart_masks(points, np.roll(points, -1, 0), np.array(angle, float), grow)


def inside(points, p):
    a, b = points, np.roll(points, -1, 0)
    above = (a[:, 1] > p[1]) != (b[:, 1] > p[1])
    x = a[above, 0] + (p[1] - a[above, 1]) * (b - a)[above, 0] / (b - a)[above, 1]
    return (x > p[0]).sum() % 2 == 1


def distance(points, p):
    a, d = points, np.roll(points, -1, 0) - points
    t = np.clip(((p - a) * d).sum(1) / (d * d).sum(1), 0, 1)
    return 0.0 if inside(points, p) else np.linalg.norm(a + t[:, None] * d - p, axis=1).min()


@pytest.mark.parametrize("grow", [0.0, 0.4, 1.3, 2.5])
def test_a_mask_covers_the_grown_chart_and_hardly_more(grow):
    angles = [0.0, 0.3, np.pi / 2, 2.5]
    found = masks(L_SHAPE, angles, grow)
    np.testing.assert_array_equal(found.angle, angles)
    assert found.area == pytest.approx(found.cells.sum((1, 2)))
    for k, angle in enumerate(angles):
        c, s = np.cos(angle), np.sin(angle)
        turned = L_SHAPE @ np.array([[c, s], [-s, c]])
        rows, columns = found.size[k]
        assert not found.cells[k, rows + 1 :].any()
        assert not found.cells[k, :, columns + 1 :].any()
        for row in range(rows):
            for column in range(columns):
                centre = found.low[k] + [column + 0.5, row + 0.5]
                # half a diagonal of a cell beyond the chart grown by a little more than asked
                if found.cells[k, row, column]:
                    assert distance(turned, centre) <= grow + 0.13 + np.sqrt(0.5)
                else:
                    assert not inside(turned, centre)
        # the outermost cells that the grown chart reaches, on all four sides
        y, x = np.nonzero(found.cells[k])
        reached = np.stack([x, y], 1) + found.low[k]
        np.testing.assert_allclose(reached.max(0), np.floor(turned.max(0) + grow), atol=1)
        np.testing.assert_allclose(reached.min(0), np.floor(turned.min(0) - grow), atol=1)
        if grow >= 0.4:
            assert (reached.max(0) + 1 > turned.max(0) + 0.7 * grow).all()
            assert (reached.min(0) < turned.min(0) - 0.7 * grow).all()
        if grow == 0:  # every cell that the boundary runs through
            t = np.linspace(0, 1, 60)[:, None, None]
            cells = np.floor(turned * (1 - t) + np.roll(turned, -1, 0) * t - found.low[k])
            column, row = cells.reshape(-1, 2).astype(int).T
            assert (
                found.cells[k, np.minimum(row, rows - 1), np.minimum(column, columns - 1)].mean()
                > 0.98
            )
        low, high = turned.min(0) - grow, turned.max(0) + grow
        assert (found.low[k] <= low).all()
        assert (found.low[k] + [columns, rows] >= high).all()
        assert (found.low[k] + [columns, rows] <= high + 2.1).all()


def test_holes_stay_free_and_overlapping_layers_are_full():
    outer = np.array([[-8.0, -8], [8, -8], [8, 8], [-8, 8]])
    hole = outer[::-1] / 2
    start = np.concatenate([outer, hole])
    end = np.concatenate([np.roll(outer, -1, 0), np.roll(hole, -1, 0)])
    found = chart_masks(start, end, np.zeros(1), 0.0)
    middle = np.array(found.cells.shape[1:]) // 2
    assert not found.cells[0][middle[0], middle[1]]
    same_way = np.concatenate([outer, outer / 2])
    ends = np.concatenate([np.roll(outer, -1, 0), np.roll(outer / 2, -1, 0)])
    assert chart_masks(same_way, ends, np.zeros(1), 0.0).cells[0][2:-2, 2:-2].all()


@pytest.mark.parametrize("turn", [0, 1])
def test_a_sliver_is_covered_all_along(turn):
    """40 cells long, nowhere near a cell wide: it covers no centre, but touches every column."""
    sliver = np.array([[0.0, 0.1], [40.0, 0.2], [40.0, 0.4]])[:, :: 1 - 2 * turn]
    found = masks(sliver, [0.0], 0.0)
    y, x = np.nonzero(found.cells[0])
    along = (y if turn else x) + int(found.low[0, turn])
    assert set(range(40)) <= set(along.tolist())
