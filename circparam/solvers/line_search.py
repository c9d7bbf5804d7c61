"""Armijo's rule for many independent problems at once: each has a step length of its own."""

from collections.abc import Callable
from typing import Any

import numpy as np

from circparam.core.arrays import FloatArray

# least decrease, as a share of the decrease that the slope predicts (Nocedal, Wright 2006, 3.4)
ARMIJO_SHARE = 1e-4
SHORTEST_STEP = 1e-10  # share of the first step below which there is no descent


def backtrack(
    evaluate: Callable[[FloatArray], tuple[FloatArray, Any]],
    step: FloatArray,
    value: FloatArray,
    slope: FloatArray,
) -> tuple[FloatArray, tuple[FloatArray, Any]]:
    """Halve steps (n,) until every value falls; returns (steps, 0 where none lowers it, what they lead to).

    evaluate: steps (n,) → (values (n,), anything else). value, slope: (n,) where the steps begin.
    """
    while True:
        found = evaluate(step)
        with np.errstate(invalid="ignore"):
            bad = (step > 0) & ~(found[0] <= value + ARMIJO_SHARE * step * slope)
        if not bad.any():
            return step, found
        step = np.where(bad, np.where(step < SHORTEST_STEP, 0.0, step / 2), step)
