"""Convex combination maps: every inner vertex is a weighted mean of its neighbours, the boundary is convex.

One algorithm for all weight schemes. With positive weights nothing flips in exact arithmetic (Tutte 1963,
Floater 1997); ``embed`` repairs flips from double precision.
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.linalg import Factor
from circparam.core.monitor import Monitor
from circparam.errors import TopologyError
from circparam.mesh.cut_mesh import CutMesh, close_holes, not_disks
from circparam.solvers.tutte.boundary import BOUNDARIES
from circparam.solvers.tutte.outer import TutteOptions
from circparam.solvers.tutte.weights import WEIGHTS, clamp_negative, half_edge_weights


def tutte_embedding(
    cut_mesh: CutMesh,
    weights: str = "circle",
    options: TutteOptions | None = None,
    monitor: Monitor | None = None,
    grade: FloatArray | None = None,
) -> tuple[FloatArray, IntArray]:
    """Map all charts at once onto convex boundaries: one block system, one factorisation, two right-hand sides.

    cut_mesh: disks, holes allowed (closed by virtual faces for the solve). weights: row of WEIGHTS. grade:
    (n_vertices,), multiplies w_ij by exp(grade_i − grade_j), which keeps all signs (see ``embed``).
    Returns ((n_vertices, 2) uv in units of the mesh, every chart centred on the origin with about its own
    area; (n_charts,) half-edges that leave a free vertex with a negative weight, before clamping).
    Raises OptionError for an unknown name, TopologyError if a chart is no disk, NoResultError if the
    system is singular (never with positive weights).
    """
    monitor, options = monitor or Monitor(), options or TutteOptions()
    scheme = WEIGHTS[weights].function
    place = BOUNDARIES[options.boundary].function
    require_boundary(cut_mesh)
    with monitor.stage("weights"):
        fixed = place(close_holes(cut_mesh), options)
        w = half_edge_weights(fixed.cut_mesh, scheme)
        if grade is not None:
            # w_ij · exp(grade_i − grade_j); vertices that close holes lie as deep as the deepest round
            # them, and those outside the boundary at 0
            i, j = fixed.cut_mesh.faces.ravel(), fixed.cut_mesh.faces[:, [1, 2, 0]].ravel()
            full = np.zeros(fixed.cut_mesh.n_vertices)
            full[: len(grade)] = grade
            new = i >= len(grade)
            np.maximum.at(full, i[new], full[j[new]])
            w = w * np.exp(full[i] - full[j])
        free = np.ones(fixed.cut_mesh.n_vertices, bool)
        free[fixed.vertices] = False
        bad = (w < 0) & free[fixed.cut_mesh.faces.ravel()]
        negative = np.bincount(
            fixed.cut_mesh.chart[np.flatnonzero(bad) // 3], minlength=fixed.cut_mesh.n_charts
        )
        if options.clamp and negative.any():
            w = clamp_negative(fixed.cut_mesh, w)
        uv = np.zeros((fixed.cut_mesh.n_vertices, 2))
        uv[fixed.vertices] = fixed.uv
        matrix, to_fixed = assemble(fixed.cut_mesh, w, free)
    with monitor.stage("solve"):
        uv[free] = Factor(matrix).solve(to_fixed @ uv[~free])
    return uv[: cut_mesh.n_vertices], negative


def assemble(
    cut_mesh: CutMesh, w: FloatArray, free: BoolArray
) -> tuple[sps.csr_matrix, sps.csr_matrix]:
    """(I − W on the free vertices, W from free to fixed), the rows of W scaled to sum 1.

    All half-edges that leave a free vertex are inner ones, so each entry comes up once.
    """
    i = cut_mesh.faces.ravel()
    j = cut_mesh.faces[:, [1, 2, 0]].ravel()
    use = free[i]
    i, j, w = i[use], j[use], w[use]
    w = w / group_sum(w, i, cut_mesh.n_vertices)[i]
    number = np.where(free, np.cumsum(free), np.cumsum(~free)) - 1
    n = int(free.sum())
    inside, own = free[j], np.arange(n)
    rows, columns = np.r_[own, number[i[inside]]], np.r_[own, number[j[inside]]]
    entries = np.r_[np.ones(n), -w[inside]]
    ends = number[i[~inside]], number[j[~inside]]
    return (
        sps.csr_matrix((entries, (rows, columns)), shape=(n, n)),
        sps.csr_matrix((w[~inside], ends), shape=(n, cut_mesh.n_vertices - n)),
    )


def require_boundary(cut_mesh: CutMesh) -> None:
    """Raise TopologyError unless every chart is a disk, with or without holes."""
    bad = np.flatnonzero(not_disks(cut_mesh))
    if len(bad):
        c = int(bad[0])
        loops = int((cut_mesh.loops.chart == c).sum())
        genus = int(2 - loops - cut_mesh.euler()[c]) // 2
        raise TopologyError(
            f"chart {c} has {loops} boundaries and genus {genus}: a map into the plane needs "
            "at least one boundary and genus 0. Cut it first: --cut disk"
        )
