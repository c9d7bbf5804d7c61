"""A convex map that also survives long thin protrusions, in double precision.

A convex map shrinks a tube of length L and circumference C by exp(−2πL/C) towards its tip, below the resolution
of numbers near 1. Faces then flip in spite of Tutte's theorem. The theorem admits any positive weights. Such
charts are therefore solved again with other weights. These bind each vertex more to its neighbours nearer to
the boundary: ``w_ij · exp(b (d_i − d_j))``, d the number of edges from the boundary. The tube then shrinks by
about exp(−(2π)² L h / (2 b C²)) only, h the length of an edge.
"""

from collections.abc import Callable

import numpy as np

from circparam.core.arrays import mask_of
from circparam.core.graph import distances, undirected
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.distortion import at_best_scales, measure
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.tutte.outer import TutteOptions
from circparam.solvers.untangle import flips, untangle

GRADES = (0.5, 1.0, 2.0, 3.0)  # strengths b, tried in turn
# Symmetric Dirichlet energy / 4 above which a convex map makes a poor start. A full
# Newton step leaves 9/16 of the energy of a nearly collapsed face: about 20 steps from here, 60 from the 10¹⁵
# of a long tube.
POOR_START = 1e5


def embed(
    cut_mesh: CutMesh, weights: str, options: TutteOptions, monitor: Monitor
) -> tuple[FloatArray, list[str]]:
    """The convex map of a weight scheme with 0 flips wherever double precision allows; all charts together.

    cut_mesh: disks, holes allowed. weights: row of WEIGHTS. Returns (uv (n_vertices, 2), notes). Charts
    without flips are exactly the map of the scheme; notes name the others.
    """
    uv, negative = tutte_embedding(cut_mesh, weights, options, monitor)
    notes = []
    if negative.any():
        cure = "lifted by --clamp" if options.clamp else "faces may flip: --clamp makes it safe"
        charts = np.count_nonzero(negative)
        notes.append(f"{weights}: {negative.sum()} negative weights in {charts} charts; {cure}")
    bad = flips(cut_mesh, uv) > 0
    if not bad.any() or not options.repair:
        return uv, notes
    if not negative[bad].any() or options.clamp:
        uv, mended = _graded(cut_mesh, weights, options, monitor, uv, bad, flips)
        done = np.flatnonzero(mended)
        if len(done):
            names = ", ".join(map(str, done[:5])) + (", ..." if len(done) > 5 else "")
            notes.append(
                f"{weights}: {len(done)} charts ({names}) have protrusions too long for double "
                "precision; weights graded towards the boundary keep their faces apart"
            )
    left = int(flips(cut_mesh, uv).sum())
    if left:
        hold = None if options.boundary == "virtual" else _outer_vertices(cut_mesh)
        with monitor.stage("unfold"):
            uv, untangled = untangle(cut_mesh, uv, hold, monitor, conformal=True)
        after = int(untangled.after.sum())
        cure = "mended by the foldover-free energy" + (f" but for {after}" if after else "")
        notes.append(f"{weights}: {left} flipped faces, {cure}")
    return uv, notes


def embed_start(
    cut_mesh: CutMesh, weights: str, options: TutteOptions, monitor: Monitor
) -> tuple[FloatArray, list[str]]:
    """``embed`` as a start for relaxation: collapsed charts take the graded weights of least distortion.

    A tube with L/C = 6 starts at a symmetric Dirichlet energy of 77 instead of 3e15, and converges in 14 steps
    instead of 52. Returns (uv, notes), every chart at its own best scale.
    """
    uv, notes = embed(cut_mesh, weights, options, monitor)
    poor = _energies(cut_mesh, uv) > POOR_START
    if poor.any():
        uv, _ = _graded(cut_mesh, weights, options, monitor, uv, poor, _sound_energies)
        notes.append(
            f"{weights}: {int(poor.sum())} charts start from weights graded towards the boundary"
        )
    return at_best_scales(cut_mesh, uv), notes


def _energies(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(n_charts,) symmetric Dirichlet energy / 4 of each chart at its own best scale."""
    return measure(cut_mesh, at_best_scales(cut_mesh, uv)).charts["sd"]


def _sound_energies(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """As ``_energies``, infinite for charts with flips."""
    return np.where(flips(cut_mesh, uv) > 0, np.inf, _energies(cut_mesh, uv))


def _graded(
    cut_mesh: CutMesh,
    weights: str,
    options: TutteOptions,
    monitor: Monitor,
    uv: FloatArray,
    charts: BoolArray,
    cost: Callable[[CutMesh, FloatArray], FloatArray | IntArray],
) -> tuple[FloatArray, BoolArray]:
    """Charts ((n_charts,) bool) solved again with increasing grades; each keeps its map of least cost.

    Returns (uv, the charts whose cost fell to 0).
    """
    uv, left = uv.copy(), charts.copy()
    for strength in GRADES:
        part, vertices, _ = cut_mesh.subset(left)
        new, _ = tutte_embedding(part, weights, options, monitor, strength * boundary_depth(part))
        after = cost(part, new)
        better = (after < cost(part, uv[vertices]))[part.vertex_chart]
        uv[vertices[better]] = new[better]
        left[left] = after > 0
        if not left.any():
            break
    return uv, charts & ~left


def boundary_depth(cut_mesh: CutMesh) -> FloatArray:
    """(n_vertices,) number of edges between a vertex and the outer boundary of its chart."""
    source = np.flatnonzero(_outer_vertices(cut_mesh))
    i, j = cut_mesh.faces.ravel(), cut_mesh.faces[:, [1, 2, 0]].ravel()
    depth = distances(undirected(cut_mesh.n_vertices, i, j, np.ones(len(i))), source)
    return np.where(np.isfinite(depth), depth, 0.0)


def _outer_vertices(cut_mesh: CutMesh) -> BoolArray:
    """(n_vertices,) on the outer boundary: a convex boundary stays where it is."""
    loops = cut_mesh.loops
    outer = loops.half_edges[loops.outer[loops.loop_of]]
    return mask_of(cut_mesh.n_vertices, cut_mesh.faces.ravel()[outer])
