"""Points near places: by comparing all, and by a tree."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circparam.geometry import nearby
from circparam.geometry.nearby import centres, within


@pytest.mark.parametrize("pairs", [nearby.PAIRS, 0])
@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.tuples(st.integers(1, 60), st.integers(1, 20), st.integers(1, 4)),
)
def test_near_means_a_place_of_the_own_group_within_its_reach(
    pairs: int, seed: int, sizes: tuple[int, int, int]
) -> None:
    random = np.random.default_rng(seed)
    m, k, n = sizes
    at, to = random.random((m, 2)), random.random((k, 2))
    group, of = random.integers(0, n, m), random.integers(0, n, k)
    reach = random.random(n) / 2
    reach[random.integers(0, n)] = random.choice([0.0, 0.3, np.inf])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nearby, "PAIRS", pairs)
        found = within((at, group), (to, of), reach)
    for i in range(m):
        mine = to[of == group[i]]
        distance = np.hypot(*(mine - at[i]).T).min(initial=np.inf)
        assert found[i] == (distance < reach[group[i]])


def test_a_centre_is_the_mean_of_the_corners() -> None:
    uv = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 6.0], [9.0, 9.0]])
    assert np.allclose(centres(uv, np.array([[0, 1, 2], [1, 3, 2]])), [[1, 2], [4, 5]])
