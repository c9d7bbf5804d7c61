"""Where the insides beside boundaries meet or come near, against angles and all pairs."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.geometry.boundary import BoundarySegments
from circparam.geometry.intersect import (
    NEIGHBOUR_MARGINS,
    nearby,
    segment_distance,
    windings,
)


def loops(*charts: object) -> BoundarySegments:
    """Closed polygons, counter-clockwise, a chart each; a chart with holes is a list of polygons."""
    starts, ends, chart, following = [], [], [], []
    at = 0
    for c, polygons in enumerate(charts):
        for polygon in polygons if isinstance(polygons, list) else [polygons]:
            p = np.asarray(polygon, float)
            n = len(p)
            starts.append(p)
            ends.append(np.roll(p, -1, axis=0))
            chart += [c] * n
            following += (at + (np.arange(n) + 1) % n).tolist()
            at += n
    follow = np.array(following)
    return BoundarySegments(
        np.arange(at), np.array(chart), np.concatenate(starts), np.concatenate(ends), follow,
        np.argsort(follow), np.ones(len(charts)),
    )  # fmt: skip


def random_boundary(seed: int, dense: int) -> BoundarySegments:
    """Two charts: wavy closed loops whose parts come near each other, short segments and long."""
    rng = np.random.default_rng(seed)

    def wavy(further: float) -> np.ndarray:
        t = np.sort(rng.random(int(rng.integers(8, dense)))) * 2 * np.pi
        r = 1 + 0.9 * np.sin(rng.integers(1, 9) * t + rng.random()) * rng.random() + further
        return np.stack([r * np.cos(t), r * np.sin(t)], 1)

    return loops([wavy(0.0), wavy(0.3)], wavy(0.0))


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([20, 150, 500]), st.floats(0.005, 0.3))
def test_near_parts_of_a_boundary_against_brute_force(seed, dense, reach):
    boundary = random_boundary(seed, dense)
    i, j = np.triu_indices(len(boundary.chart), 1)
    same = boundary.chart[i] == boundary.chart[j]
    i, j = i[same], j[same]
    loop, position, total = boundary.along
    apart = np.abs(position[i] - position[j])
    apart = np.minimum(apart, total[i] - apart)
    far = (loop[i] != loop[j]) | (apart > NEIGHBOUR_MARGINS * reach)
    far &= (boundary.following[i] != j) & (boundary.before[i] != j)
    i, j = i[far], j[far]
    close = segment_distance(boundary.start[i], boundary.end[i], boundary.start[j], boundary.end[j])
    for charts in ([True, True], [False, True]):
        got = nearby(boundary, np.full(2, reach), np.array(charts))
        keep = (close < reach) & np.array(charts)[boundary.chart[i]]
        assert set(zip(*(g.tolist() for g in got), strict=True)) == set(
            zip(i[keep].tolist(), j[keep].tolist(), strict=True)
        )


def box(x: float, y: float, width: float = 1.0, height: float = 1.0) -> np.ndarray:
    return np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]])


def test_chamfers_part_only_segments_with_more_boundary_between_them():
    """A long bar whose end is cut off by a short segment: its sides are near there by necessity."""
    reach = 0.1
    for short, near in ((0.08, 0), (0.18, 0), (0.2, 1)):
        # two long sides, at the right joined by a bent end of this length that keeps them within reach
        end = np.array([[20.0, 0.0], [20.0 + short / 2 - 0.025, 0.02], [20.0, 0.05]])
        length = np.linalg.norm(np.diff(end, axis=0), axis=1).sum()
        assert (length > 1.5 * reach) == bool(near)
        bar = loops(np.concatenate([end, [[0.0, 9.0], [0.0, -9.0]]]))
        for chamfers, expected in ((False, 1), (True, near)):
            i, j = nearby(bar, np.array([reach]), np.array([True]), chamfers)
            assert ((i == 2) & (j == 4)).sum() == expected


def test_many_points_are_followed_in_blocks():
    """They are cut into blocks, which bounds the memory, and each point keeps its own number."""
    p = np.random.default_rng(0).uniform(-1, 5, (450_001, 2))
    chart = np.arange(len(p)) % 2
    x, y = p.T
    inside = np.where(
        chart == 0, (x > 0) & (x < 3) & (y > 0) & (y < 3), (x > 2) & (x < 4) & (y > 2) & (y < 4)
    )
    assert (windings(loops(box(0, 0, 3, 3), box(2, 2, 2, 2)), p, chart) == inside).all()
