"""A convex map that also survives long thin protrusions, in double precision.

A tube of length L and circumference C shrinks under a convex map by exp(−2πL/C) towards its tip, below what
numbers near 1 can tell apart; faces then come out flipped although Tutte's theorem holds. Any positive weights
are as good for the theorem, so the charts that fail are solved again with weights that tie each vertex more to
its neighbours nearer to the border: ``w_ij · exp(b (d_i − d_j))``, d the number of edges from the border. The
tube then shrinks by about exp(−(2π)² L h / (2 b C²)) only, h the length of an edge.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sps
import scipy.sparse.csgraph as csgraph

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.geometry.distortion import best_chart_scales, measure
from circparam.mesh.cut_mesh import Patches
from circparam.solvers.tutte.boundary import TutteOptions
from circparam.solvers.tutte.embed import ConvexReport, embed_convex
from circparam.solvers.untangle import flipped, unfold

GRADES = (0.5, 1.0, 2.0, 3.0)
CRUSHED = 1e5  # symmetric Dirichlet energy above which a convex map makes a poor start


def embed(
    patches: Patches, weights: str, options: TutteOptions, monitor: Monitor
) -> tuple[FloatArray, list[str]]:
    """The convex map of a weight scheme with 0 flips wherever double precision allows; all charts together.

    patches: disks, holes allowed. weights: row of WEIGHTS. Returns (uv (n_vertices, 2), notes). Charts that
    come out whole at once are exactly the map of the scheme; what was done to others is in the notes.
    """
    uv, report = embed_convex(patches, weights, options, monitor)
    notes = _negative_note(weights, options, report)
    bad = _bad_charts(patches, uv)
    if not bad.any() or not options.repair:
        return uv, notes
    if not report.negative[bad].any() or options.clamp:
        uv, told = _graded(patches, weights, options, monitor, uv, bad)
        notes += told
    hold = None if options.border == "virtual" else _rim(patches)
    left = int(_flips(patches, uv).sum())
    if left:
        with monitor.stage("unfold"):
            uv, unfolded = unfold(patches, uv, hold, monitor, conformal=True)
        after = int(unfolded.after.sum())
        cure = "mended by the foldover-free energy" + (f" but for {after}" if after else "")
        notes.append(f"{weights}: {left} flipped faces, {cure}")
    return uv, notes


def embed_start(
    patches: Patches, weights: str, options: TutteOptions, monitor: Monitor
) -> tuple[FloatArray, list[str]]:
    """``embed`` as a start for relaxation: charts that it crushes take the graded weights that distort least.

    A tube with L/C = 6 starts at a symmetric Dirichlet energy of 77 instead of 3e15, and converges in 14 steps
    instead of 52. Returns (uv, notes), every chart at its own best scale.
    """
    uv, notes = embed(patches, weights, options, monitor)
    energy = _energies(patches, uv)
    crushed = energy > CRUSHED
    if crushed.any():
        part, vertices, _ = patches.subset(crushed)
        depth = border_depth(part)
        best = energy[crushed]
        for strength in GRADES:
            new, _ = embed_convex(part, weights, options, monitor, strength * depth)
            trial = _energies(part, new)
            trial[_bad_charts(part, new)] = np.inf
            better = (trial < best)[part.vertex_chart]
            uv[vertices[better]] = new[better]
            best = np.minimum(best, trial)
        notes.append(
            f"{weights}: {int(crushed.sum())} charts start from weights graded towards the border"
        )
    return uv * best_chart_scales(patches, uv)[patches.vertex_chart][:, None], notes


def _energies(patches: Patches, uv: FloatArray) -> FloatArray:
    """(n_charts,) symmetric Dirichlet energy / 4 of each chart at its own best scale."""
    scale = best_chart_scales(patches, uv)[patches.vertex_chart]
    return measure(patches, uv * scale[:, None]).charts["sd"]


def _graded(
    patches: Patches,
    weights: str,
    options: TutteOptions,
    monitor: Monitor,
    uv: FloatArray,
    bad: BoolArray,
) -> tuple[FloatArray, list[str]]:
    """Solve these charts again with graded weights, more so until nothing is flipped."""
    uv = uv.copy()
    wanted = bad.copy()
    for strength in GRADES:
        part, vertices, _ = patches.subset(bad)
        new, _ = embed_convex(part, weights, options, monitor, strength * border_depth(part))
        before = _flips(part, uv[vertices])
        after = _flips(part, new)
        better = (after < before)[part.vertex_chart]
        uv[vertices[better]] = new[better]
        bad = bad.copy()
        bad[np.flatnonzero(bad)[after == 0]] = False
        if not bad.any():
            break
    done = int((wanted & ~bad).sum())
    if not done:
        return uv, []
    names = ", ".join(str(c) for c in np.flatnonzero(wanted & ~bad)[:5])
    return uv, [
        f"{weights}: {done} charts ({names}{', ...' if done > 5 else ''}) have protrusions too long for "
        "double precision; weights graded towards the border keep their faces apart"
    ]


def border_depth(patches: Patches) -> FloatArray:
    """(n_vertices,) number of edges between a vertex and the outer border of its chart."""
    loops = patches.loops
    h = loops.half_edges[loops.outer[loops.loop_of]]
    source = np.unique(patches.faces.ravel()[h])
    i = patches.faces.ravel()
    j = patches.faces[:, [1, 2, 0]].ravel()
    n = patches.n_vertices
    graph = sps.csr_matrix((np.ones(len(i)), (i, j)), shape=(n, n))
    depth = csgraph.dijkstra(graph, directed=False, indices=source, unweighted=True, min_only=True)
    result: FloatArray = np.where(np.isfinite(depth), depth, 0.0)
    return result


def _flips(patches: Patches, uv: FloatArray) -> IntArray:
    """(n_charts,) flipped faces."""
    bad = flipped(patches.faces, uv)
    return np.bincount(patches.chart[bad], minlength=patches.n_charts)


def _bad_charts(patches: Patches, uv: FloatArray) -> BoolArray:
    """(n_charts,) charts with a flipped face."""
    return _flips(patches, uv) > 0


def _rim(patches: Patches) -> BoolArray:
    """(n_vertices,) on the outer border: a convex border stays where it is."""
    loops = patches.loops
    out = np.zeros(patches.n_vertices, bool)
    out[patches.faces.ravel()[loops.half_edges[loops.outer[loops.loop_of]]]] = True
    return out


def _negative_note(weights: str, options: TutteOptions, report: ConvexReport) -> list[str]:
    """One line where weights are negative."""
    total = int(report.negative.sum())
    if not total:
        return []
    charts = int((report.negative > 0).sum())
    cure = "lifted by --clamp" if options.clamp else "faces may flip: --clamp makes it safe"
    return [f"{weights}: {total} negative weights in {charts} charts; {cure}"]
