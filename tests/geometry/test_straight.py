"""Straight borders: the directions of a chart, and what of them lies along the axes."""

import numpy as np
import pytest

from circparam.geometry.straight import axis_parallel, directions, straight_edges


def ring(corners: np.ndarray, angle: float = 0.0, parts: int = 7) -> np.ndarray:
    """Edges (b, 2) of a polygon, each side in several, turned."""
    side = np.repeat((np.roll(corners, -1, 0) - corners) / parts, parts, axis=0)
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(side @ np.array([[c, s], [-s, c]]))


RECTANGLE = np.array([[0, 0], [3, 0], [3, 1], [0, 1.0]])
ROUND = np.stack([np.cos(t := np.arange(64) * 2 * np.pi / 64), np.sin(t)], 1)


@pytest.mark.parametrize("degrees", [0.0, 0.1, 20.0, 44.9, 89.95])
def test_a_rectangle_has_its_own_directions_at_any_angle(degrees: float) -> None:
    edges = ring(RECTANGLE, np.radians(degrees))
    found = directions(edges, np.zeros(len(edges), np.int64), 1)
    off = np.mod(found.angle[0] - np.radians(degrees) + np.pi / 4, np.pi / 2) - np.pi / 4
    assert off == pytest.approx(0, abs=1e-12)
    assert found.length[0] == pytest.approx(8.0)
    assert found.share[0] == pytest.approx(1.0)


def test_round_charts_have_no_straight_border_and_others_do() -> None:
    edges = np.concatenate([ring(ROUND, 0.3, 1), ring(RECTANGLE, 0.3)])
    owner = np.repeat([0, 1], [64, 28])
    straight = straight_edges(edges, owner, np.array([np.pi, 3.0]))
    assert straight.tolist() == [False] * 64 + [True] * 28


def test_only_the_two_directions_of_a_chart_count() -> None:
    """Of a trapezium the slanted side is no border that could lie along an axis with the others."""
    edges = ring(np.array([[0, 0], [3, 0], [2, 1], [0, 1.0]]), 0.7, 1)
    straight = straight_edges(edges, np.zeros(4, np.int64), np.array([2.5]))
    assert straight.tolist() == [True, False, True, True]


def test_what_lies_along_an_axis() -> None:
    t = np.radians([0, 90, 180, 270, 0.4, 89.7, 0.6, 45])
    assert axis_parallel(np.stack([np.cos(t), np.sin(t)], 1)).tolist() == [True] * 6 + [False] * 2
