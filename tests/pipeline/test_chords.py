"""What the boundary of an outline reaches between its anchors."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from circparam.pipeline.page_cuts import extents, turned


@given(st.integers(0, 10**6))
def test_stretches_of_a_boundary_have_the_least_boxes_and_squares_of_their_points(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(int(rng.integers(6, 40)), 2))
    pick = np.sort(rng.choice(len(p), int(rng.integers(2, min(len(p), 12))), replace=False))
    first, pieces = np.divmod(np.arange(len(pick) * (len(pick) - 1)), len(pick) - 1)
    pieces = pieces + 1
    box, square = extents(p, pick, first, pieces)
    around = np.r_[pick, pick + len(p)]
    for k, (i, n) in enumerate(zip(first.tolist(), pieces.tolist(), strict=True)):
        points = turned(p[np.arange(around[i], around[i + n] + 1) % len(p)])
        size = np.ptp(points, axis=0)
        assert np.isclose(box[k], size.prod(1).min())
        assert np.isclose(square[k], size.max(1).min())
