"""Landmarks guessed for surfaces that lie alike: aligned by their axes of inertia and closest points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.arrays import FloatArray
from circparam.core.words import percent
from circparam.errors import InputError
from circparam.maps.landmarks import Landmarks, aligned, points_of
from circparam.maps.sides import Side

GUESSED = 8  # landmarks that are guessed
FOR_HANDLE = 6  # and so many more for every handle
TRUST = 0.03  # mean distance of the aligned surfaces, in sizes, up to which a guess is made
ROUNDS = 12  # of the alignment by closest points


def guess(a: Side, b: Side) -> Landmarks:
    """Landmarks for two surfaces that lie alike: far-apart vertices of a and what is nearest to them on b,
    more for every handle, none on boundaries.

    The surfaces are aligned by their axes of inertia and closest points. Raises InputError where they do not
    fit well enough for that to be trusted.
    """
    p = points_of(a, list(range(a.n)))
    q = points_of(b, list(range(b.n)))
    error, moved = _best_motion(p, q)
    size = float(np.linalg.norm(np.ptp(q, axis=0)))
    if error > TRUST * size:
        raise InputError(
            f"{a.name} and {b.name} are too unlike to guess landmarks (aligned, {percent(error / size)} of "
            f"the size apart, {percent(TRUST)} at most): give --landmarks with 3 or more pairs"
        )
    inside = a.on_boundary < 0
    out_there = np.linalg.norm(moved - moved.mean(0), axis=1)
    chosen = [int(np.where(inside, out_there, -1).argmax())]
    distance = np.where(inside, np.inf, -1.0)
    while len(chosen) < min(GUESSED + FOR_HANDLE * a.genus, len(p)):
        distance = np.minimum(distance, np.linalg.norm(p - p[chosen[-1]], axis=1))
        chosen.append(int(distance.argmax()))
    own = np.flatnonzero(b.on_boundary < 0)
    nearest: list[int] = own[cKDTree(q[own]).query(moved[chosen])[1]].tolist()
    out = Landmarks()
    for u, v in zip(chosen, nearest, strict=True):
        if v not in out.b and u not in out.a:
            out.add(u, v, False)
    if len(out.a) < 4:
        raise InputError(
            "no landmarks, and none could be guessed: give --landmarks with 3 or more pairs"
        )
    out.notes.append(
        f"{len(out.a)} landmarks guessed from the alignment of the surfaces "
        f"(mean distance {percent(error / size)} of the size)"
    )
    return out


def _best_motion(p: FloatArray, q: FloatArray) -> tuple[float, FloatArray]:
    """(mean distance both ways, p moved) after aligning axes of inertia in all proper ways, then closest
    points.
    """
    axes_p, axes_q = (np.linalg.svd(x - x.mean(0), full_matrices=False)[2] for x in (p, q))
    step_p, step_q = (x[:: max(1, len(x) // 2000)] for x in (p, q))
    tree = cKDTree(q)
    best, motion = np.inf, np.column_stack([np.eye(3), np.zeros(3)])
    signs = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    orders = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)]
    starts = [np.column_stack([np.eye(3), q.mean(0) - p.mean(0)])]
    for order in orders:
        odd = -1 if np.linalg.det(np.eye(3)[list(order)]) < 0 else 1
        for s in signs:
            turn = axes_q.T @ (np.array(s)[:, None] * odd * axes_p[list(order)])
            turn *= np.sign(np.linalg.det(turn))
            starts.append(np.column_stack([turn, q.mean(0) - turn @ p.mean(0)]))
    for start in starts:
        now = start
        for _ in range(ROUNDS):
            moved = step_p @ now[:, :3].T + now[:, 3]
            now = aligned(step_p, q[tree.query(moved)[1]])[1]
        moved = step_p @ now[:, :3].T + now[:, 3]
        there = float(np.mean(tree.query(moved)[0]))
        error = (there + float(np.mean(cKDTree(moved).query(step_q)[0]))) / 2
        if error < best - 1e-9:
            best, motion = error, now
    return best, p @ motion[:, :3].T + motion[:, 3]
