"""Points near places: by comparing all, and by a tree."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from circparam.geometry.nearby import centres, within


@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.tuples(st.integers(1, 60), st.integers(1, 20), st.integers(1, 4)),
)
@example(seed=0, sizes=(2500, 1800, 3))
def test_near_means_a_place_of_the_own_group_within_its_reach(seed, sizes):
    """All are compared up to four million pairs, beyond by a tree."""
    random = np.random.default_rng(seed)
    m, k, n = sizes
    at, to = random.random((m, 2)), random.random((k, 2))
    group, of = random.integers(0, n, m), random.integers(0, n, k)
    reach = random.random(n) / np.sqrt(k)
    reach[random.integers(0, n)] = random.choice([0.0, 0.3, np.inf])
    distance = np.linalg.norm(at[:, None] - to, axis=2)
    distance[group[:, None] != of] = np.inf
    expected = distance.min(1) < reach[group]
    assert np.array_equal(within((at, group), (to, of), reach), expected)


def test_a_centre_is_the_mean_of_the_corners() -> None:
    uv = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 6.0], [9.0, 9.0]])
    assert np.allclose(centres(uv, np.array([[0, 1, 2], [1, 3, 2]])), [[1, 2], [4, 5]])
