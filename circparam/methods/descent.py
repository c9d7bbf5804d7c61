"""L-BFGS on many independent problems at once: step lengths, memory and stopping are those of each group."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from circparam.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.progress import Monitor

Energy: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
Precondition: TypeAlias = Callable[[FloatArray], FloatArray]

ARMIJO = 1e-4
HALVINGS = 40


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
    """Minimise the energy of every group of vertices (Nocedal, Wright 2006, algorithm 7.4, a start matrix given).

    energy: x (v, 2) → (energies (n,), gradient (v, 2), zero where a vertex is held). group: (v,) int64.
    precondition: an approximate inverse Hessian, block diagonal over the groups. tolerance: a group stops when
    its energy falls by less than this share in two steps on end. Returns (x, iterations (n,), reasons).
    """
    value, gradient = energy(x)
    open_groups = np.ones(n, bool)
    steps = np.zeros(n, np.int64)
    idle = np.zeros(n, np.int64)
    reasons = np.full(n, "iterations", dtype="<U16")
    pairs: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for iteration in range(limit):
        direction = -_two_loop(gradient, pairs, group, n, precondition)
        slope = _dot(gradient, direction, group, n)
        uphill = ~(slope < 0)
        if uphill.any():  # forget the memory where it misleads: steepest descent
            plain = -precondition(gradient)
            direction = np.where(uphill[group][:, None], plain, direction)
            slope = _dot(gradient, direction, group, n)
        trial, new_value, moved = _line_search(
            energy, x, value, direction, slope, group, open_groups
        )
        _, new_gradient = energy(trial)
        s, y = trial - x, new_gradient - gradient
        curvature = _dot(s, y, group, n)
        norm = np.sqrt(_dot(s, s, group, n) * _dot(y, y, group, n))
        inverse = np.where(curvature > 1e-12 * norm, 1 / np.where(curvature > 0, curvature, 1), 0)
        pairs = [*pairs, (s, y, inverse)][-memory:]
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
    pairs: list[tuple[FloatArray, FloatArray, FloatArray]],
    group: IntArray,
    n: int,
    precondition: Precondition,
) -> FloatArray:
    """The inverse Hessian of the memory times the gradient; a pair without curvature has no effect."""
    q = gradient.copy()
    alphas = []
    for s, y, inverse in reversed(pairs):
        alpha = inverse * _dot(s, q, group, n)
        alphas.append(alpha)
        q -= alpha[group][:, None] * y
    r = precondition(q)
    if pairs:
        s, y, inverse = pairs[-1]
        length = _dot(y, precondition(y), group, n)
        good = (inverse > 0) & (length > 0)
        scale = np.where(good, 1 / np.where(good, inverse * length, 1.0), 1.0)
        r *= scale[group][:, None]
    for (s, y, inverse), alpha in zip(pairs, reversed(alphas), strict=True):
        beta = inverse * _dot(y, r, group, n)
        r += (alpha - beta)[group][:, None] * s
    return r


def _line_search(
    energy: Energy,
    x: FloatArray,
    value: FloatArray,
    direction: FloatArray,
    slope: FloatArray,
    group: IntArray,
    open_groups: BoolArray,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Armijo backtracking for each group; returns (x, energies, which groups have moved)."""
    step = np.where(open_groups & (slope < 0), 1.0, 0.0)
    for _ in range(HALVINGS):
        trial = x + step[group][:, None] * direction
        new_value, _ = energy(trial)
        with np.errstate(invalid="ignore"):
            enough = new_value <= value + ARMIJO * step * slope
        enough |= step == 0
        if enough.all():
            break
        step = np.where(enough, step, step / 2)
    else:
        step = np.where(enough, step, 0.0)
        trial = x + step[group][:, None] * direction
        new_value, _ = energy(trial)
    still = step == 0
    return trial, np.where(still, value, new_value), ~still
