"""Convergence to a known answer: the conformal map of a hemisphere is the stereographic projection."""

import numpy as np
import pytest

from tests.support import shapes
from tests.support.charts import apart, complex_of, flattened, patches_of


@pytest.mark.parametrize(
    ("method", "converges"),
    [("harmonic", True), ("lscm", True), ("bff", True), ("mean-value", False), ("uniform", False)],
)
def test_the_error_falls_with_the_square_of_the_edge_length(method: str, converges: bool) -> None:
    """Those that are no conformal maps stay as far away as they are: the control of this test."""
    errors = []
    for n in (6, 12, 24):
        cut_mesh, points = patches_of(shapes.hemisphere(n))
        z = complex_of(points[:, :2]) / (1 + points[:, 2])
        errors.append(apart(flattened(method, cut_mesh).uv, np.stack([z.real, z.imag], 1)))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates.min() > 1.6 if converges else rates.max() < 0.5, (errors, rates)
