"""Convex combination maps: every inner vertex is a weighted mean of its neighbours, the border is convex.

One algorithm for all weight schemes. With positive weights nothing flips in exact arithmetic (Tutte 1963,
Floater 1997); ``embed`` mends what double precision spoils.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.linalg import Factor
from circparam.core.monitor import Monitor
from circparam.errors import TopologyError
from circparam.mesh.cut_mesh import Patches, close_holes
from circparam.solvers.tutte.boundary import BORDERS, TutteOptions
from circparam.solvers.tutte.weights import WEIGHTS, clamp_negative, half_edge_weights


@dataclass(frozen=True, eq=False)
class ConvexReport:
    """negative (n_charts,): half-edges that leave a free vertex with a negative weight, before
    clamping. clamped: whether they were lifted. system: what was solved, to solve it again.
    """

    negative: IntArray
    clamped: bool
    system: ConvexSystem


@dataclass(frozen=True, eq=False)
class ConvexSystem:
    """uv_i = Σ w_ij uv_j for the free vertices, block diagonal over the charts.

    patches: holes closed, virtual faces behind the real ones. free (n,): vertex is unknown. matrix: I − W on
    the free vertices, rows of W summing to one. to_fixed: W from the free to the fixed ones. fixed_uv.
    """

    patches: Patches
    free: BoolArray
    matrix: sps.csr_matrix
    to_fixed: sps.csr_matrix
    fixed_uv: FloatArray
    factor: Factor

    def solve(self, fixed_uv: FloatArray) -> FloatArray:
        """(n, 2) places of all vertices for places of the fixed ones."""
        uv = np.empty((self.patches.n_vertices, 2))
        uv[~self.free] = fixed_uv
        uv[self.free] = self.factor.solve(self.to_fixed @ fixed_uv)
        return uv


def embed_convex(
    patches: Patches,
    weights: str = "circle",
    options: TutteOptions | None = None,
    monitor: Monitor | None = None,
    grade: FloatArray | None = None,
) -> tuple[FloatArray, ConvexReport]:
    """Map all charts at once onto convex borders: one block system, one factorisation, two right-hand sides.

    patches: disks, holes allowed (closed by virtual faces for the solve). weights: row of WEIGHTS. grade:
    (n_vertices,), multiplies w_ij by exp(grade_i − grade_j), which keeps all signs (see ``embed``).
    Returns ((n_vertices, 2) uv in units of the mesh, every chart centred on the origin with about its own
    area; report).
    Raises OptionError for an unknown name, TopologyError where a chart is no disk, NoResultError where the
    system is singular (never with positive weights).
    """
    monitor, options = monitor or Monitor(), options or TutteOptions()
    scheme = WEIGHTS[weights].function
    place = BORDERS[options.border].function
    require_border(patches)
    with monitor.stage("weights"):
        closed, _ = close_holes(patches)
        fixed = place(closed, options)
        w = half_edge_weights(fixed.patches, scheme)
        if grade is not None:
            w = _graded(fixed.patches, w, grade)
        free = np.ones(fixed.patches.n_vertices, bool)
        free[fixed.vertices] = False
        negative = _count_negative(fixed.patches, w, free)
        if options.clamp and negative.any():
            w = clamp_negative(fixed.patches, w)
        fixed_uv = np.zeros((fixed.patches.n_vertices, 2))
        fixed_uv[fixed.vertices] = fixed.uv
        matrix, to_fixed = _assemble(fixed.patches, w, free)
    with monitor.stage("solve"):
        factor = Factor(matrix)
        system = ConvexSystem(fixed.patches, free, matrix, to_fixed, fixed_uv[~free], factor)
        uv = system.solve(system.fixed_uv)
    return uv[: patches.n_vertices], ConvexReport(negative, options.clamp, system)


def _count_negative(patches: Patches, w: FloatArray, free: BoolArray) -> IntArray:
    """(n_charts,) half-edges that leave a free vertex with a negative weight."""
    bad = (w < 0) & free[patches.faces.ravel()]
    return np.bincount(patches.chart[np.flatnonzero(bad) // 3], minlength=patches.n_charts)


def _graded(patches: Patches, w: FloatArray, grade: FloatArray) -> FloatArray:
    """w_ij · exp(grade_i − grade_j); the vertices that close holes lie as deep as the deepest round them, and
    those outside the border at 0."""
    i, j = patches.faces.ravel(), patches.faces[:, [1, 2, 0]].ravel()
    full = np.zeros(patches.n_vertices)
    full[: len(grade)] = grade
    new = i >= len(grade)
    np.maximum.at(full, i[new], full[j[new]])
    return w * np.exp(full[i] - full[j])


def _assemble(
    patches: Patches, w: FloatArray, free: BoolArray
) -> tuple[sps.csr_matrix, sps.csr_matrix]:
    """(I − W on the free vertices, W from free to fixed), the rows of W scaled to sum 1.

    All half-edges that leave a free vertex are inner ones, so each entry comes up once.
    """
    i = patches.faces.ravel()
    j = patches.faces[:, [1, 2, 0]].ravel()
    use = free[i]
    i, j, w = i[use], j[use], w[use]
    w = w / group_sum(w, i, patches.n_vertices)[i]
    number = np.where(free, np.cumsum(free), np.cumsum(~free)) - 1
    n = int(free.sum())
    inside = free[j]
    diagonal = np.arange(n)
    matrix = sps.csr_matrix(
        (
            np.concatenate([np.ones(n), -w[inside]]),
            (
                np.concatenate([diagonal, number[i[inside]]]),
                np.concatenate([diagonal, number[j[inside]]]),
            ),
        ),
        shape=(n, n),
    )
    to_fixed = sps.csr_matrix(
        (w[~inside], (number[i[~inside]], number[j[~inside]])),
        shape=(n, patches.n_vertices - n),
    )
    return matrix, to_fixed


def require_border(patches: Patches) -> None:
    """Raise TopologyError unless every chart is a disk, with or without holes."""
    loops = np.bincount(patches.loops.chart, minlength=patches.n_charts)
    bad = np.flatnonzero((loops == 0) | (patches.euler() != 2 - loops))
    if len(bad):
        c = int(bad[0])
        genus = int(2 - loops[c] - patches.euler()[c]) // 2
        raise TopologyError(
            f"chart {c} has {loops[c]} borders and genus {genus}: a map into the plane needs "
            "at least one border and genus 0. Cut it first: --cut disk"
        )
