"""Turn flipped faces back: the foldover-free energy on small regions round them.

All regions of all charts form one problem. A region grows, up to its whole chart, until it is free of flips.
Vertices on its boundary stay fixed, so the rest of the map does not change.
"""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import foldover
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.region import WHOLE, grow, moving_region

# Widths of the region round a flipped face, tried in turn. A wide one leaves room for shape; a map whose scale
# varies much, as conformal ones do, is kept best by a narrow one.
USUAL_RINGS = (8, 3, 20, WHOLE)
CONFORMAL_RINGS = (2, 5, 12, 30, WHOLE)
FEW_FLIPS_RINGS = (3, 8, 20, WHOLE)  # if only a few faces are wrong
HARDLY = 1.05  # times the faces of the region tried before, up to which a region is the same one
POLISH = 10  # Newton steps on untangled charts, for their shape


@dataclass(frozen=True, eq=False)
class UntangleReport:
    """before, after (n_charts,): flipped faces of each chart. rings: widest region that was needed."""

    before: IntArray
    after: IntArray
    rings: int


def flipped(faces: IntArray, uv: FloatArray) -> BoolArray:
    """(m,) the face is flipped or collapsed, or too thin for its sign to be certain in floating point."""
    p = uv[faces]
    d, e = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    left, right = d[:, 0] * e[:, 1], d[:, 1] * e[:, 0]
    result: BoolArray = ~(left - right > 1e-15 * (np.abs(left) + np.abs(right)))
    return result


def untangle(
    cut_mesh: CutMesh,
    uv: FloatArray,
    hold: BoolArray | None = None,
    monitor: Monitor | None = None,
    conformal: bool = False,
    near: bool = False,
) -> tuple[FloatArray, UntangleReport]:
    """A layout near ``uv`` without flipped faces, if the energy finds one.

    uv: (n_vertices, 2). hold: (n_vertices,) vertices that keep their places (none by default). Charts without
    flips are returned as they are. conformal: the map keeps angles rather than areas. near: only the
    flips are wrong, so narrow regions come first. Returns (uv, report); the input is not changed.
    """
    hold = np.zeros(cut_mesh.n_vertices, bool) if hold is None else hold
    n = cut_mesh.n_charts
    first = bad = flipped(cut_mesh.faces, uv)
    widest, tried, last = 0, 0, np.zeros_like(first)
    uv = uv.copy()
    touched = np.zeros(len(cut_mesh.faces), bool)
    for rings in CONFORMAL_RINGS if conformal else FEW_FLIPS_RINGS if near else USUAL_RINGS:
        if not bad.any() or (monitor is not None and monitor.expired):
            break
        widest = rings
        region = grow(cut_mesh, bad, rings)
        if np.array_equal(bad, last) and region.sum() <= HARDLY * tried:
            continue  # a larger region of equal faces would fail again
        last, tried = bad, int(region.sum())
        touched |= region
        part = moving_region(cut_mesh, region, hold, uv)
        x = foldover.lower(part, uv[part.source], monitor)
        # a region is kept only where it has fewer flips than before: the next one starts from the better map
        now = np.bincount(part.chart[flipped(part.faces, x)], minlength=part.n_groups)
        old = np.bincount(part.chart[flipped(part.faces, uv[part.source])], minlength=part.n_groups)
        keep = (now < old)[part.cut_mesh.vertex_chart] & ~part.fixed
        uv[part.source[keep]] = x[keep]
        bad = flipped(cut_mesh.faces, uv)
    if touched.any():
        uv = _polished(cut_mesh, uv, touched, hold, 1.0 if conformal else 0.0)
        bad = flipped(cut_mesh.faces, uv)
    count = [np.bincount(cut_mesh.chart[b], minlength=n) for b in (first, bad)]
    return uv, UntangleReport(count[0], count[1], widest)


def _polished(
    cut_mesh: CutMesh, uv: FloatArray, touched: BoolArray, hold: BoolArray, blend: float
) -> FloatArray:
    """A few Newton steps where faces have moved: untangling leaves them upright, and the steps restore their
    shape. Groups with a flipped face do not change."""
    part = moving_region(cut_mesh, touched, hold, uv)
    if part.fixed.all():
        return uv
    options = RelaxOptions(tolerance=1e-3, max_iterations=POLISH, fixed=part.fixed, blend=blend)
    x = relax(part.cut_mesh, uv[part.source], options).uv
    out = uv.copy()
    moved = ~part.fixed
    out[part.source[moved]] = x[moved]
    return out
