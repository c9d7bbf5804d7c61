"""Points of outlines that come near each other, against all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.nest.contacts import (
    THINNED_SHARE,
    find_contacts,
    sample_outlines,
    to_world,
)
from circparam.packing.outlines import shapes_of
from circparam.packing.placement import Placement

SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


def polygons(*rings):
    """Charts that are fans about the first corner of each ring."""
    at = np.cumsum([0, *(len(r) for r in rings)])
    faces = [
        np.stack([0 * i, i, i + 1], 1) + a
        for a, r in zip(at, rings, strict=False)
        for i in [np.arange(1, len(r) - 1)]
    ]
    chart = np.repeat(np.arange(len(rings)), [len(f) for f in faces])
    return shapes_of(np.concatenate(faces), np.concatenate(rings), chart)


def outlines(*rings, step=0.1):
    return sample_outlines(polygons(*rings), step)


def at(*offsets, scale=1.0, angle=None, page=None):
    n = len(offsets)
    turned = np.zeros(n) if angle is None else np.array(angle, float)
    return Placement(scale, turned, np.array(offsets, float), np.array(page or [0] * n))


def test_samples_lie_on_their_edges_at_most_a_step_apart():
    for step in (0.07, 0.5, 3.0):
        found = outlines(SQUARE, SQUARE * 2, step=step)
        for c in (0, 1):
            on = found.chart == c
            points = found.points[on] / (c + 1)
            assert np.abs(points).max(1) == pytest.approx(np.ones(len(points)))  # on the boundary
            ring = points[np.argsort(np.arctan2(points[:, 1], points[:, 0]))]
            gaps = np.linalg.norm(np.roll(ring, -1, 0) - ring, axis=1)
            assert gaps.max() <= (2.0 if step >= 2 else step / (c + 1)) * (1 + 1e-9)
            for corner in SQUARE:
                assert np.abs(points - corner).sum(1).min() < 1e-12
        d = found.end - found.start
        t = ((found.points - found.start) * d).sum(1) / (d * d).sum(1)
        np.testing.assert_allclose(found.start + t[:, None] * d, found.points, atol=1e-12)
        assert ((t >= -1e-12) & (t <= 1)).all()
        assert (np.diff(found.chart) >= 0).all()


def test_short_edges_are_thinned_but_nowhere_lost():
    t = np.arange(1000) * 2 * np.pi / 1000
    circle = np.stack([np.cos(t), np.sin(t)], 1)
    thinned = outlines(circle, step=0.4).points
    assert len(thinned) < 2 * 2 * np.pi / (0.4 * THINNED_SHARE)
    assert len(outlines(circle, step=0.005).points) >= 1000
    far = np.linalg.norm(circle[:, None] - thinned, axis=2).min(1)
    assert far.max() <= 0.4 * THINNED_SHARE * np.sqrt(2) + 1e-9


def test_world_turns_scales_and_moves():
    placement = at([0, 0], [3, 4], scale=2.0, angle=[0, np.pi / 2])
    here = to_world(placement, np.array([1, 0]), np.array([[1.0, 0], [1, 0]]))
    np.testing.assert_allclose(here, [[3, 6], [2, 0]], atol=1e-12)


def random_contacts(seed, side, n=6, reach=2.5):
    rng = np.random.default_rng(seed)
    rings = []
    for _ in range(n):
        t = np.sort(rng.uniform(0, 2 * np.pi, 7))
        rings.append(np.stack([np.cos(t), np.sin(t)], 1))
    samples = outlines(*rings, step=0.05)
    placement = at(
        *rng.uniform(0, 14, (n, 2)), scale=1.7, angle=rng.uniform(0, 6, n), page=[0, 0, 0, 0, 1, 1]
    )
    world = to_world(placement, samples.chart, samples.points)
    return placement, samples, world, find_contacts(placement, samples, reach, side)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("side", [0.0, 0.3, 4.0])
def test_contacts_against_all_pairs(seed, side):
    """Every pair of charts of a page nearer than the reach is found once, with its least distance."""
    reach = 2.5
    placement, samples, world, found = random_contacts(seed, side)
    assert len(found.i)
    assert (found.i < found.j).all()
    assert (placement.page[found.i] == placement.page[found.j]).all()
    distance = np.linalg.norm(found.p - found.q, axis=1)
    assert distance.max() <= reach + 1e-9
    for i in range(6):
        for j in range(i + 1, 6):
            here = (found.i == i) & (found.j == j)
            pairs = world[samples.chart == i][:, None] - world[samples.chart == j]
            gap = np.linalg.norm(pairs, axis=2).min()
            near = placement.page[i] == placement.page[j] and gap < reach - 1e-9
            assert here.any() == near
            if near:
                assert distance[here].min() == pytest.approx(gap, abs=0.05 * 1.7)
                assert distance[here].min() <= gap + 1e-9  # to the edge, not to its sample


def test_of_each_square_only_the_nearest_pair_counts():
    """Fewer contacts on larger squares, and each that is left out has a nearer one about a square away."""
    side = 0.7
    *_, everything = random_contacts(1, 0.0)
    *_, thinned = random_contacts(1, side)
    assert 0 < len(thinned.i) < len(everything.i) / 3
    distance = [np.linalg.norm(c.p - c.q, axis=1) for c in (everything, thinned)]
    middle = [(c.p + c.q) / 2 for c in (everything, thinned)]
    for k in range(len(everything.i)):
        same = (thinned.i == everything.i[k]) & (thinned.j == everything.j[k])
        close = np.linalg.norm(middle[1][same] - middle[0][k], axis=1) < side * np.sqrt(2) + 0.1
        assert distance[1][same][close].min() <= distance[0][k] + 0.1


def test_the_nearest_point_of_an_edge_counts_not_its_sample():
    """A tip over a long edge, between two of its samples: the tip is a sample, the point below it is not."""
    wall = np.array([[-5.0, -1], [5, -1], [5, 0], [-5, 0]])
    tip = np.array([[0.0, 0.0], [1, 2], [-1, 2]])
    samples = outlines(wall, tip, step=0.9)
    found = find_contacts(at([0, 0], [0.137, 1.8]), samples, 2.5, 1.0)
    assert np.linalg.norm(found.p - found.q, axis=1).min() == pytest.approx(0.3, abs=1e-9)


def test_far_charts_have_no_contacts():
    samples = outlines(SQUARE, SQUARE)
    found = find_contacts(at([0, 0], [9, 0]), samples, 6.9)
    assert len(found.i) == 0
    assert found.p.shape == found.q.shape == (0, 2)
    near = find_contacts(at([0, 0], [9, 0]), samples, 7.2)
    assert np.linalg.norm(near.p - near.q, axis=1).min() == pytest.approx(7.0)
    assert len(find_contacts(at([0, 0], [0, 0], page=[0, 1]), samples, 7.2).i) == 0


@pytest.mark.parametrize("step", [0.05, 0.3, 1.5])
def test_a_tip_through_a_neighbour_is_seen_at_any_step(step):
    """A needle and a wall of two long edges, wherever the samples of both happen to lie."""
    wall = np.array([[-5.0, 0], [5, 0], [5, 0.2], [-5, 0.2]])
    needle = np.array([[-0.1, 0.0], [0.1, 0], [0.0, 3]])
    for x in np.linspace(-3, 3, 7):
        for foot, crossing in ((-1.7, True), (-2.9, True), (-3.05, False), (0.7, False)):
            # places are those of the middles: 0.1 above the wall's foot, 1.5 above the needle's
            here = at([0, 0.1], [x, foot + 1.5])
            found = find_contacts(here, outlines(wall, needle, step=step), 3.0, 1.0)
            assert found.crossing == crossing
