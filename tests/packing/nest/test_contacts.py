"""Points of outlines that come near each other, against all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.nest.contacts import find_contacts, sample_outlines, to_world
from circparam.packing.outlines import shapes_of
from circparam.packing.placement import Placement


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
