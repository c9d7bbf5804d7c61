"""L-BFGS on many independent problems at once: step lengths, memory and stopping are those of each group."""

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import dot2, group_sum
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.solvers.line_search import backtrack

Energy: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
Precondition: TypeAlias = Callable[[FloatArray], FloatArray]
MEMORY_PAIRS = 8  # pairs in memory; Nocedal and Wright (2006, section 7.2) advise 3 to 20
CURVED_COSINE = 1e-12  # sᵀy / ‖s‖‖y‖ from which the curvature of a pair exceeds rounding
IDLE_STEPS = 2  # consecutive steps below the tolerance after which a group stops


@dataclass(frozen=True)
class DescentOptions:
    """tolerance: a group stops when its energy falls by less than this share in two steps on end.

    limit: bound on the steps.
    """

    tolerance: float
    limit: int


@dataclass(frozen=True, eq=False)
class Groups:
    """Vertices of independent problems: of (v,) int64, the group of each; count, the number of groups."""

    of: IntArray
    count: int

    def dot(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """(count,) inner product of vectors (v, 2) in each group."""
        return group_sum(dot2(a, b), self.of, self.count)

    def spread(self, values: np.ndarray) -> np.ndarray:
        """(v, 1) the value (count,) of its group for every vertex."""
        return values[self.of][:, None]


@dataclass(frozen=True, eq=False)
class Descent:
    """x (v, 2); steps (count,) taken by each group; reasons: why each stopped."""

    x: FloatArray
    steps: IntArray
    reasons: list[str]


class _Memory:
    """The last steps s of a descent, and the changes y of the gradient along them: an inverse Hessian."""

    def __init__(self, groups: Groups, precondition: Precondition) -> None:
        self.groups, self.precondition = groups, precondition
        # s, y and, for each group, 1/sᵀy (0: no use)
        self.pairs: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        self.scale = np.ones(groups.count)  # of the preconditioner, by the last pair

    def add(self, s: FloatArray, y: FloatArray) -> None:
        """Keep a pair; without use in groups with negative curvature and in groups that have not moved."""
        dot = self.groups.dot
        curvature, norm = dot(s, y), np.sqrt(dot(s, s) * dot(y, y))
        curved = curvature > CURVED_COSINE * norm
        inverse = np.where(curved, 1 / np.where(curvature > 0, curvature, 1), 0)
        length = dot(y, self.precondition(y))
        good = (inverse > 0) & (length > 0)
        self.scale = np.where(good, 1 / np.where(good, inverse * length, 1.0), 1.0)
        self.pairs = [*self.pairs, (s, y, inverse)][-MEMORY_PAIRS:]

    def direction(self, gradient: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(direction (v, 2), its slope (count,)): minus the inverse Hessian times the gradient (algorithm 7.4).

        Steepest descent where the memory misleads uphill.
        """
        dot, spread = self.groups.dot, self.groups.spread
        q, alphas = gradient.copy(), []
        for s, y, inverse in reversed(self.pairs):
            alphas.append(inverse * dot(s, q))
            q -= spread(alphas[-1]) * y
        r = self.precondition(q) * spread(self.scale)
        for (s, y, inverse), alpha in zip(self.pairs, reversed(alphas), strict=True):
            r += spread(alpha - inverse * dot(y, r)) * s
        direction, slope = -r, dot(gradient, -r)
        uphill = ~(slope < 0)
        if uphill.any():
            direction = np.where(spread(uphill), -self.precondition(gradient), direction)
            slope = dot(gradient, direction)
        return direction, slope


def descend(
    energy: Energy,
    x: FloatArray,
    groups: Groups,
    precondition: Precondition,
    options: DescentOptions,
    monitor: Monitor | None = None,
) -> Descent:
    """Minimise the energy of every group of vertices (Nocedal, Wright 2006, algorithm 7.5).

    energy: x (v, 2) → (energies (count,), gradient (v, 2), zero at fixed vertices). precondition: an
    approximate inverse Hessian, block diagonal over the groups.
    """
    value, gradient = energy(x)
    n = groups.count
    going = np.ones(n, bool)
    steps, idle = np.zeros(n, np.int64), np.zeros(n, np.int64)
    reasons = np.full(n, "iterations", dtype="<U16")
    memory = _Memory(groups, precondition)
    for iteration in range(options.limit):
        direction, slope = memory.direction(gradient)
        step, (after, (there, gradient_there)) = backtrack(
            partial(_along, energy, x, direction, groups),
            np.where(going & (slope < 0), 1.0, 0.0),
            value,
            slope,
        )
        memory.add(there - x, gradient_there - gradient)
        moved = step > 0
        after = np.where(moved, after, value)
        steps += going & moved
        idle = np.where(value - after > options.tolerance * np.abs(after), 0, idle + 1)
        reasons[going & (idle >= IDLE_STEPS)] = "converged"
        reasons[going & ~moved] = "no lower step"
        going &= moved & (idle < IDLE_STEPS)
        x, value, gradient = there, after, gradient_there
        if monitor is not None:
            monitor.update(iteration / options.limit, f"energy {value.sum():.6g}")
            if monitor.expired:
                reasons[going] = "out of time"
                break
        if not going.any():
            break
    return Descent(x, steps, [str(r) for r in reasons])


def _along(
    energy: Energy, x: FloatArray, direction: FloatArray, groups: Groups, step: FloatArray
) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    """(energies, (places, gradient)) after steps (count,) along a direction."""
    there = x + groups.spread(step) * direction
    value, gradient = energy(there)
    return value, (there, gradient)
