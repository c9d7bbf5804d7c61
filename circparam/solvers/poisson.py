"""Lay charts out from the Jacobians their faces should have, by one linear solve for all charts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_of_runs,
    group_sum,
    next_half_edge,
)
from circparam.core.linalg import Factor
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet


def laplacian(cut_mesh: CutMesh) -> sps.csr_matrix:
    """(nv, nv) cotangent Laplacian of all charts, positive semidefinite, from the rest triangles alone."""
    g = cut_mesh.gradients
    weight = -(g * g[:, :, [1, 2, 0]]).sum(1) * cut_mesh.areas[:, None]  # of half-edge 3f + k
    flat = cut_mesh.faces.ravel()
    h = np.arange(len(flat))
    tail, head, w = flat, flat[next_half_edge(h)], weight.ravel()
    n = cut_mesh.n_vertices
    off = sps.coo_matrix((np.r_[-w, -w], (np.r_[tail, head], np.r_[head, tail])), shape=(n, n))
    diagonal = group_sum(np.r_[w, w], np.r_[tail, head], n)
    return (off + sps.diags(diagonal)).tocsr()


def first_vertices(cut_mesh: CutMesh) -> IntArray:
    """(n_charts,) one vertex of every chart, to pin its translation."""
    order = np.argsort(cut_mesh.vertex_chart, kind="stable")
    return order[first_of_runs(cut_mesh.vertex_chart[order])]


@dataclass(frozen=True, eq=False)
class PoissonSystem:
    """The factored Laplacian of a cut mesh. pins: vertices that stay; unknown: the others; rows: theirs."""

    pins: IntArray
    unknown: IntArray
    rows: sps.csr_matrix
    factor: Factor

    @staticmethod
    def of(cut_mesh: CutMesh, pins: IntArray | None = None) -> PoissonSystem:
        """Factor the Laplacian; pins: at least one vertex of every chart (None: the first)."""
        pins = first_vertices(cut_mesh) if pins is None else pins
        free = np.ones(cut_mesh.n_vertices, bool)
        free[pins] = False
        unknown = np.flatnonzero(free)
        rows = laplacian(cut_mesh)[unknown]
        return PoissonSystem(pins, unknown, rows, Factor(rows[:, unknown].tocsc()))


def from_jacobians(
    cut_mesh: CutMesh,
    targets: FloatArray,
    untangle: int = 0,
    low: float = 0.5,
    held: tuple[IntArray, FloatArray] | None = None,
    system: PoissonSystem | None = None,
) -> tuple[FloatArray, BoolArray]:
    """The layout u that minimises Σ area |J(u) − target|², and which charts are free of flips.

    targets: (2, 2, m). untangle: while a chart has flipped faces, clamp the singular values of its Jacobians
    to [low, 1/low], read as a rotation times a stretch, and solve again with the same factor, at most so many
    times (the local/global idea of Liu and others 2008). held: vertices (k,) of every chart and their places
    (k, 2); None: the first vertex of every chart lies at the origin. system: that of the cut mesh and those
    vertices, where it is at hand.
    Returns (uv (nv, 2), (n_charts,) bool: no face flipped).
    """
    n = cut_mesh.n_vertices
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    corners = cut_mesh.faces.T
    pins, places = (None, None) if held is None else held
    system = PoissonSystem.of(cut_mesh, pins) if system is None else system
    unknown = system.unknown
    uv = np.zeros((n, 2))
    moving = np.ones(n, bool)
    for step in range(untangle + 1):
        flux = targets * cut_mesh.areas
        right = np.stack(
            [
                group_sum(
                    (flux[d, 0] * gradients[0] + flux[d, 1] * gradients[1]).ravel(),
                    corners.ravel(),
                    n,
                )
                for d in range(2)
            ],
            1,
        )
        solution = np.zeros((n, 2))
        if places is not None:
            solution[system.pins] = places
            right[unknown] -= system.rows[:, system.pins] @ places
        solution[unknown] = system.factor.solve(right[unknown])
        uv[moving] = solution[moving]
        jacobian = dirichlet.jacobians(gradients, uv[cut_mesh.faces].transpose(2, 1, 0))
        flipped = np.zeros(cut_mesh.n_charts, bool)
        flipped[cut_mesh.chart[~(dirichlet.determinants(jacobian) > 0)]] = True
        if not flipped.any() or step == untangle:
            break
        again = flipped[cut_mesh.chart]
        targets = targets.copy()
        targets[:, :, again] = clamp_stretch(jacobian[:, :, again], low)
        moving = flipped[cut_mesh.vertex_chart]
    return uv, ~flipped


def clamp_stretch(jacobian: FloatArray, low: float) -> FloatArray:
    """Each J (2, 2, m) with its signed singular values clamped to [low, 1/low]: never flipped afterwards."""
    (a, b), (c, d) = jacobian
    e, f, g, h = (a + d) / 2, (a - d) / 2, (c + b) / 2, (c - b) / 2
    q, r = np.hypot(e, h), np.hypot(f, g)
    s1, s2 = np.clip(q + r, low, 1 / low), np.clip(q - r, low, 1 / low)
    with np.errstate(
        all="ignore"
    ):  # a pure reflection has no rotation to scale, a similarity no reflection
        turn, bend = (s1 + s2) / 2 / q, (s1 - s2) / 2 / r
        e, h = np.where(q > 0, e * turn, (s1 + s2) / 2), np.where(q > 0, h * turn, 0.0)
        f, g = np.where(r > 0, f * bend, 0.0), np.where(r > 0, g * bend, 0.0)
    return np.stack([np.stack([e + f, g - h]), np.stack([g + h, e - f])])
