"""Exact signs, against rationals."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from circparam.geometry.predicates import orientation
from tests.support.exact import exact_sign

coordinate = st.one_of(
    st.floats(-1, 1),
    st.floats(allow_nan=False, allow_infinity=False, width=64, min_value=-1e150, max_value=1e150),
    st.integers(-3, 3).map(float),
    st.sampled_from([0.1, 0.2, 0.3, 1e-300, 5e-324, 0.5 + 2**-53, 12.0, 24.0]),
)
point = st.tuples(coordinate, coordinate)


@given(point, point, point)
@example((0.1, 0.1), (0.2, 0.2), (0.3, 0.3))
@example((5e-324, 0.0), (0.0, 5e-324), (0.0, 0.0))
@example((1e150, 5e-324), (1e150, 0.0), (5e-324, 1e150))
def test_orientation_is_exact(a, b, c):
    got = orientation(*(np.array([p]) for p in (a, b, c)))
    assert int(got[0]) == exact_sign(a, b, c)


def test_orientation_is_exact_where_floating_point_is_known_to_fail():
    """The grid of Kettner and others (2008): points a few last digits from (½, ½), against one diagonal."""
    k = np.arange(64) * 2.0**-53
    p = np.stack(np.meshgrid(0.5 + k, 0.5 + k), -1).reshape(-1, 2)
    q, r = np.full_like(p, 12.0), np.full_like(p, 24.0)
    got = orientation(p, q, r)
    assert np.array_equal(got, [exact_sign(a, (12, 12), (24, 24)) for a in p])
    plain = (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])
    assert (np.sign(plain) != got).any(), "the case is hard enough"
    for scale in (1e-140, 1e140):
        far = [exact_sign(*(scale * x for x in corners)) for corners in zip(p, q, r, strict=True)]
        assert np.array_equal(orientation(p * scale, q * scale, r * scale), far)
