"""Convex combination maps: every inner vertex is a weighted mean of its neighbours, the boundary is convex.

One algorithm for all weight schemes. With positive weights nothing flips in exact arithmetic (Tutte 1963,
Floater 1997); ``embed`` repairs flips from double precision.
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import group_count, group_sum, mask_of
from circparam.core.linalg import HeldFactor
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray, IntArray
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
        work = fixed.cut_mesh
        i, j = work.faces.ravel(), work.faces[:, [1, 2, 0]].ravel()
        w = half_edge_weights(work, scheme)
        if grade is not None:
            # vertices that close holes lie as deep as the deepest round them, those outside the boundary at 0
            depth = np.zeros(work.n_vertices)
            depth[: len(grade)] = grade
            new = i >= len(grade)
            np.maximum.at(depth, i[new], depth[j[new]])
            w = w * np.exp(depth[i] - depth[j])
        free = ~mask_of(work.n_vertices, fixed.vertices)
        bad = np.flatnonzero((w < 0) & free[i])
        negative = group_count(work.chart[bad // 3], work.n_charts)
        if options.clamp and len(bad):
            w = clamp_negative(work, w)
    with monitor.stage("solve"):
        system = HeldFactor(assemble(work, w, free), fixed.vertices)
        uv = system.solve(np.zeros((len(free), 2)), fixed.uv)
    return uv[: cut_mesh.n_vertices], negative


def assemble(cut_mesh: CutMesh, w: FloatArray, free: BoolArray) -> sps.csr_matrix:
    """I − W in the rows of the free vertices, the rows of W scaled to sum 1.

    All half-edges that leave a free vertex are inner ones, so each entry comes up once.
    """
    n, own = cut_mesh.n_vertices, np.flatnonzero(free)
    i, j = cut_mesh.faces.ravel(), cut_mesh.faces[:, [1, 2, 0]].ravel()
    use = free[i]
    i, j, w = i[use], j[use], w[use]
    entries = np.r_[np.ones(len(own)), -w / group_sum(w, i, n)[i]]
    return sps.csr_matrix((entries, (np.r_[own, i], np.r_[own, j])), shape=(n, n))


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
