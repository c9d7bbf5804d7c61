"""L-BFGS on many independent problems at once: step lengths, memory and stopping are those of each group."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.monitor import Monitor

Energy: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

Precondition: TypeAlias = Callable[[FloatArray], FloatArray]
ARMIJO = 1e-4
HALVINGS = 40


@dataclass(frozen=True, eq=False)
class _Pair:
    """A step s and the change y of the gradient along it; for each group 1/sᵀy (0: no use) and yᵀHy."""

    s: FloatArray
    y: FloatArray
    inverse: FloatArray
    length: FloatArray


def descend(
    energy: Energy,
    x: FloatArray,
    group: IntArray,
    n: int,
    precondition: Precondition,
    tolerance: float,
    limit: int,
    memory: int = 8,
    monitor: Monitor | None = None,
) -> tuple[FloatArray, IntArray, list[str]]:
    """Minimise the energy of every group of vertices (Nocedal, Wright 2006, algorithm 7.4).

    energy: x (v, 2) → (energies (n,), gradient (v, 2), zero where a vertex is held). group: (v,) int64.
    precondition: an approximate inverse Hessian, block diagonal over the groups. tolerance: a group stops when
    its energy falls by less than this share in two steps on end. Returns (x, iterations (n,), reasons).
    """
    value, gradient = energy(x)
    open_groups = np.ones(n, bool)
    steps = np.zeros(n, np.int64)
    idle = np.zeros(n, np.int64)
    reasons = np.full(n, "iterations", dtype="<U16")
    pairs: list[_Pair] = []
    for iteration in range(limit):
        direction = -_two_loop(gradient, pairs, group, n, precondition)
        slope = _dot(gradient, direction, group, n)
        uphill = ~(slope < 0)
        if uphill.any():  # forget the memory where it misleads: steepest descent
            plain = -precondition(gradient)
            direction = np.where(uphill[group][:, None], plain, direction)
            slope = _dot(gradient, direction, group, n)
        trial, new_value, new_gradient, moved = _line_search(
            energy, x, value, direction, slope, group, open_groups
        )
        s, y = trial - x, new_gradient - gradient
        curvature = _dot(s, y, group, n)
        norm = np.sqrt(_dot(s, s, group, n) * _dot(y, y, group, n))
        inverse = np.where(curvature > 1e-12 * norm, 1 / np.where(curvature > 0, curvature, 1), 0)
        length = _dot(y, precondition(y), group, n)
        pairs = [*pairs, _Pair(s, y, inverse, length)][-memory:]
        gain = value - new_value
        steps += open_groups & moved
        idle = np.where(gain > tolerance * np.abs(new_value), 0, idle + 1)
        reasons[open_groups & (idle >= 2)] = "converged"
        reasons[open_groups & ~moved] = "no lower step"
        open_groups &= moved & (idle < 2)
        x, value, gradient = trial, new_value, new_gradient
        if monitor is not None:
            monitor.update(iteration / limit, f"energy {value.sum():.6g}")
            if monitor.expired:
                reasons[open_groups] = "out of time"
                break
        if not open_groups.any():
            break
    return x, steps, [str(r) for r in reasons]


def _dot(a: FloatArray, b: FloatArray, group: IntArray, n: int) -> FloatArray:
    """(n,) inner product of each group."""
    return group_sum((a * b).sum(1), group, n)


def _two_loop(
    gradient: FloatArray,
    pairs: list[_Pair],
    group: IntArray,
    n: int,
    precondition: Precondition,
) -> FloatArray:
    """The inverse Hessian of the memory times the gradient; a pair without curvature has no effect."""
    q = gradient.copy()
    alphas = []
    for pair in reversed(pairs):
        alpha = pair.inverse * _dot(pair.s, q, group, n)
        alphas.append(alpha)
        q -= alpha[group][:, None] * pair.y
    r = precondition(q)
    if pairs:
        last = pairs[-1]
        good = (last.inverse > 0) & (last.length > 0)
        scale = np.where(good, 1 / np.where(good, last.inverse * last.length, 1.0), 1.0)
        r *= scale[group][:, None]
    for pair, alpha in zip(pairs, reversed(alphas), strict=True):
        beta = pair.inverse * _dot(pair.y, r, group, n)
        r += (alpha - beta)[group][:, None] * pair.s
    return r


def _line_search(
    energy: Energy,
    x: FloatArray,
    value: FloatArray,
    direction: FloatArray,
    slope: FloatArray,
    group: IntArray,
    open_groups: BoolArray,
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Armijo backtracking for each group; returns (x, energies, gradient, which groups have moved)."""
    step = np.where(open_groups & (slope < 0), 1.0, 0.0)
    for _ in range(HALVINGS):
        trial = x + step[group][:, None] * direction
        new_value, gradient = energy(trial)
        with np.errstate(invalid="ignore"):
            enough = new_value <= value + ARMIJO * step * slope
        enough |= step == 0
        if enough.all():
            break
        step = np.where(enough, step, step / 2)
    else:
        step = np.where(enough, step, 0.0)
        trial = x + step[group][:, None] * direction
        new_value, gradient = energy(trial)
    still = step == 0
    return trial, np.where(still, value, new_value), gradient, ~still
