"""Pairs of segments that may meet: none is missed, and their number grows with that of the segments."""

import numpy as np
import pytest

from circparam.geometry.intersect import properly_cross
from circparam.geometry.segment_grid import Candidates


@pytest.mark.parametrize("shape", ["comb", "star", "uneven", "stack"])
def test_the_work_grows_with_the_number_of_segments(shape):
    """Pairs looked at for each segment stay bounded as the number of segments grows."""

    def pairs_a_segment(n):
        rng = np.random.default_rng(1)
        if shape == "comb":  # long teeth side by side
            x = np.arange(n) / n
            start, end = np.stack([x, np.zeros(n)], 1), np.stack([x, np.ones(n)], 1)
        elif shape == "star":  # rays that stop short of the middle
            t = 2 * np.pi * np.arange(n) / n
            ray = np.stack([np.cos(t), np.sin(t)], 1)
            start, end = 0.2 * ray, ray
        elif shape == "uneven":  # most of the segments in one corner
            start = rng.random((n, 2)) ** 8
            end = start + 1e-3 / n * rng.normal(size=(n, 2))
            end[:3] = start[:3] + 1
        else:  # several segments in each place
            start = np.repeat(rng.random((n // 4, 2)), 4, 0)
            end = start + 1e-4
        group = np.zeros(len(start), np.int64)
        return sum(len(i) for i, _ in Candidates(start, end, group, np.zeros(len(start)))) / n

    assert pairs_a_segment(16000) < 4 * pairs_a_segment(1000) + 40


def found_pairs(start, end, group=None):
    n = len(start)
    group = np.zeros(n, np.int64) if group is None else np.asarray(group)
    candidates = Candidates(np.asarray(start, float), np.asarray(end, float), group, np.zeros(n))
    pairs = [(i, j) for a, b in candidates for i, j in zip(a.tolist(), b.tolist(), strict=True)]
    return candidates, pairs


def test_one_segment_none_and_points_of_no_length():
    assert found_pairs(np.zeros((0, 2)), np.zeros((0, 2)))[1] == []
    assert found_pairs([[0, 0]], [[1, 1]])[1] == []
    same = np.full((3, 2), 7.0)
    assert set(found_pairs(same, same)[1]) == {(0, 1), (0, 2), (1, 2)}
    assert found_pairs(same, same, [0, 2, 5])[1] == [], "labels in between may be missing"


def test_pairs_beyond_a_chunk_are_all_handed_out_once():
    """2100 segments of no length on each other: two million pairs and more."""
    n = 2100
    candidates = Candidates(np.ones((n, 2)), np.ones((n, 2)), np.zeros(n, np.int64), np.zeros(n))
    parts = [a * n + b for a, b in candidates]
    assert len(parts) > 1
    keys = np.concatenate(parts)
    assert len(keys) == n * (n - 1) // 2
    assert np.bincount(keys).max() == 1
    assert not len(candidates.crowded)


def crossing(start, end):
    """(i, j), i < j, of all segments that cross properly, by brute force."""
    i, j = np.triu_indices(len(start), 1)
    cross = properly_cross(start[i], end[i], start[j], end[j])
    return set(zip(i[cross].tolist(), j[cross].tolist(), strict=True))


def test_a_pile_that_no_grid_parts_is_looked_at_in_full():
    n = 70
    rng = np.random.default_rng(2)
    start = np.r_[np.zeros((n, 2)), rng.random((40, 2)) * 9]
    end = np.r_[np.ones((n, 2)), rng.random((40, 2)) * 9]
    candidates, pairs = found_pairs(start, end)
    assert {(i, j) for i in range(n) for j in range(i + 1, n)} <= set(pairs)
    assert crossing(start, end) <= set(pairs)
    assert not len(candidates.crowded)
