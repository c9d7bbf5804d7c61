"""L-BFGS on many independent problems at once: step lengths, memory and stopping are those of each group."""

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, dot2, group_sum
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
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

    def spread(self, values: FloatArray) -> FloatArray:
        """(v, 1) the value (count,) of its group for every vertex."""
        return values[self.of][:, None]


@dataclass(frozen=True, eq=False)
class Descent:
    """x (v, 2); steps (count,) taken by each group; reasons: why each stopped."""

    x: FloatArray
    steps: IntArray
    reasons: list[str]


@dataclass(frozen=True, eq=False)
class _Pair:
    """A step s and the change y of the gradient along it; for each group 1/sᵀy (0: no use) and yᵀHy."""

    s: FloatArray
    y: FloatArray
    inverse: FloatArray
    length: FloatArray


@dataclass(frozen=True, eq=False)
class _Point:
    """x (v, 2), the energies of the groups and the gradient (v, 2)."""

    x: FloatArray
    value: FloatArray
    gradient: FloatArray


def _along(
    energy: Energy, at: _Point, direction: FloatArray, groups: Groups, step: FloatArray
) -> tuple[FloatArray, _Point]:
    """The point that steps (count,) along a direction lead to, its energies first."""
    x = at.x + groups.spread(step) * direction
    value, gradient = energy(x)
    return value, _Point(x, value, gradient)


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
    at = _Point(x, *energy(x))
    n = groups.count
    going = np.ones(n, bool)
    steps, idle = np.zeros(n, np.int64), np.zeros(n, np.int64)
    reasons = np.full(n, "iterations", dtype="<U16")
    pairs: list[_Pair] = []
    for iteration in range(options.limit):
        direction, slope = _direction(at.gradient, pairs, groups, precondition)
        step, (_, new) = backtrack(
            partial(_along, energy, at, direction, groups),
            np.where(going & (slope < 0), 1.0, 0.0),
            at.value,
            slope,
        )
        moved = step > 0
        new = _Point(new.x, np.where(moved, new.value, at.value), new.gradient)
        pairs = [*pairs, _pair(at, new, groups, precondition)][-MEMORY_PAIRS:]
        steps += going & moved
        gain = at.value - new.value
        idle = np.where(gain > options.tolerance * np.abs(new.value), 0, idle + 1)
        reasons[going & (idle >= IDLE_STEPS)] = "converged"
        reasons[going & ~moved] = "no lower step"
        going &= moved & (idle < IDLE_STEPS)
        at = new
        if monitor is not None:
            monitor.update(iteration / options.limit, f"energy {at.value.sum():.6g}")
            if monitor.expired:
                reasons[going] = "out of time"
                break
        if not going.any():
            break
    return Descent(at.x, steps, [str(r) for r in reasons])


def _pair(before: _Point, after: _Point, groups: Groups, precondition: Precondition) -> _Pair:
    """The pair of a step; zero in groups with negative curvature and in groups that have not moved."""
    s, y = after.x - before.x, after.gradient - before.gradient
    curvature = groups.dot(s, y)
    norm = np.sqrt(groups.dot(s, s) * groups.dot(y, y))
    inverse = np.where(
        curvature > CURVED_COSINE * norm, 1 / np.where(curvature > 0, curvature, 1), 0
    )
    return _Pair(s, y, inverse, groups.dot(y, precondition(y)))


def _direction(
    gradient: FloatArray, pairs: list[_Pair], groups: Groups, precondition: Precondition
) -> tuple[FloatArray, FloatArray]:
    """(direction (v, 2), its slope (count,)): steepest descent where the memory misleads uphill."""
    direction = -_two_loop(gradient, pairs, groups, precondition)
    slope = groups.dot(gradient, direction)
    uphill = ~(slope < 0)
    if uphill.any():
        direction = np.where(uphill[groups.of][:, None], -precondition(gradient), direction)
        slope = groups.dot(gradient, direction)
    return direction, slope


def _two_loop(
    gradient: FloatArray, pairs: list[_Pair], groups: Groups, precondition: Precondition
) -> FloatArray:
    """The inverse Hessian of the memory times the gradient (algorithm 7.4); a pair without curvature has no
    effect."""
    q = gradient.copy()
    alphas = []
    for pair in reversed(pairs):
        alpha = pair.inverse * groups.dot(pair.s, q)
        alphas.append(alpha)
        q -= groups.spread(alpha) * pair.y
    r = precondition(q)
    if pairs:
        last = pairs[-1]
        good = (last.inverse > 0) & (last.length > 0)
        scale = np.where(good, 1 / np.where(good, last.inverse * last.length, 1.0), 1.0)
        r *= groups.spread(scale)
    for pair, alpha in zip(pairs, reversed(alphas), strict=True):
        beta = pair.inverse * groups.dot(pair.y, r)
        r += groups.spread(alpha - beta) * pair.s
    return r
