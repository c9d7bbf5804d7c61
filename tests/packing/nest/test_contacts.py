"""Points of outlines that come near each other, against all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.nest.contacts import (
    find_contacts,
    least_distance,
    sample_outline,
    to_world,
)
from circparam.packing.placement import Placement

SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


def outline(points, step=0.1):
    return sample_outline(points, np.roll(points, -1, 0), step)


def at(*offsets, scale=1.0, angle=None, page=None):
    n = len(offsets)
    turned = np.zeros(n) if angle is None else np.array(angle, float)
    return Placement(scale, turned, np.array(offsets, float), np.array(page or [0] * n))


def test_samples_lie_on_their_edges_at_most_a_step_apart():
    for step in (0.07, 0.5, 3.0):
        found = outline(SQUARE, step)
        along = np.sort(np.arctan2(found.points[:, 1], found.points[:, 0]))
        assert np.abs(found.points).max(1) == pytest.approx(np.ones(len(along)))  # on the boundary
        ring = found.points[np.argsort(np.arctan2(found.points[:, 1], found.points[:, 0]))]
        gaps = np.linalg.norm(np.roll(ring, -1, 0) - ring, axis=1)
        assert gaps.max() <= max(step, 2.0 if step >= 2 else step) * (1 + 1e-9)
        for corner in SQUARE:
            assert np.abs(found.points - corner).sum(1).min() < 1e-12
        d = found.end - found.start
        t = ((found.points - found.start) * d).sum(1) / (d * d).sum(1)
        np.testing.assert_allclose(found.start + t[:, None] * d, found.points, atol=1e-12)
        assert ((t >= -1e-12) & (t <= 1)).all()
    assert {tuple(p) for p in outline(SQUARE).hull} == {tuple(p) for p in SQUARE}


def test_short_edges_are_thinned_and_lines_have_a_hull():
    t = np.arange(1000) * 2 * np.pi / 1000
    circle = np.stack([np.cos(t), np.sin(t)], 1)
    count = len(outline(circle, 0.2).points)
    assert 2 * np.pi / 0.2 < count < 2 * 2 * np.pi / 0.1
    line = np.array([[0.0, 0], [1, 0], [2, 0]])
    np.testing.assert_array_equal(outline(line).hull, line)


def test_world_turns_scales_and_moves():
    placement = at([0, 0], [3, 4], scale=2.0, angle=[0, np.pi / 2])
    np.testing.assert_allclose(to_world(placement, 1, np.array([[1.0, 0]])), [[3, 6]])


@pytest.mark.parametrize("seed", range(6))
def test_contacts_against_all_pairs(seed):
    """Every pair of boundaries nearer than the reach is found, from both sides, with its least distance."""
    rng = np.random.default_rng(seed)
    n, reach = 6, 2.5
    outlines = []
    for _ in range(n):
        t = np.sort(rng.uniform(0, 2 * np.pi, 7))
        outlines.append(outline(np.stack([np.cos(t), np.sin(t)], 1), 0.05))
    placement = at(
        *rng.uniform(0, 14, (n, 2)), scale=1.7, angle=rng.uniform(0, 6, n), page=[0, 0, 0, 0, 1, 1]
    )
    found = find_contacts(placement, outlines, reach)
    world = [to_world(placement, c, o.points) for c, o in enumerate(outlines)]
    assert len(found.i)
    assert (placement.page[found.i] == placement.page[found.j]).all()
    distance = np.linalg.norm(found.p - found.q, axis=1)
    assert distance.max() <= reach + 0.05 * 1.7
    for i in range(n):
        for j in range(n):
            here = (found.i == i) & (found.j == j)
            gap = np.linalg.norm(world[i][:, None] - world[j], axis=2).min()
            near = i != j and placement.page[i] == placement.page[j] and gap < reach - 0.1
            assert here.any() or not near
            if here.any():
                assert i != j
                assert distance[here].min() == pytest.approx(gap, abs=0.05 * 1.7)
                assert distance[here].min() <= gap + 1e-9  # to the edge, not to its sample
    assert least_distance(found) == distance.min()


def test_far_charts_have_no_contacts():
    found = find_contacts(at([0, 0], [9, 0]), [outline(SQUARE)] * 2, 6.9)
    assert len(found.i) == 0
    assert found.p.shape == found.q.shape == (0, 2)
    assert least_distance(found) == np.inf
    assert least_distance(find_contacts(at([0, 0], [9, 0]), [outline(SQUARE)] * 2, 7.2)) == 7.0
