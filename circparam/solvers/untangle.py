"""Turn flipped faces back: the foldover-free energy on small regions round them.

All regions of all charts form one problem. A region grows, up to its whole chart, until it is free of flips.
Vertices on its boundary stay fixed, so the rest of the map does not change.

The energy is that of Garanzha et al. 2021 ("Foldover-free maps in 50 lines of code"). It is finite on flipped
faces too: its parameter ε falls with the worst determinant, and the energy becomes a barrier once every face is
upright.
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import group_boxes, group_count, group_min, group_sum
from circparam.core.linalg import HeldFactor
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet
from circparam.solvers.lbfgs import DescentOptions, Groups, descend
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.region import WHOLE, Region, grow, moving_region

# Widths of the region round a flipped face, tried in turn. A wide one leaves room for shape; a map whose scale
# varies much, as conformal ones do, is kept best by a narrow one.
USUAL_RINGS = (8, 3, 20, WHOLE)
CONFORMAL_RINGS = (2, 5, 12, 30, WHOLE)
FEW_FLIPS_RINGS = (3, 8, 20)  # if only a few faces are wrong; what stays flipped is cut off
# times the faces of the region tried before, up to which a region is the same one
HARDLY_RATIO = 1.05
POLISH_STEPS = 10  # Newton steps on untangled charts, for their shape
OUTER_ROUNDS = 25  # rounds, each with an ε of its own
# rounds without fewer flips or a worst determinant better by BETTER
BARREN, BETTER = 5, 0.9
DESCENT = DescentOptions(tolerance=1e-4, limit=60)
FAR_ROOTS = 1e4  # times the root of its area: a group of this width is given up
AREA_WEIGHT = 1.0  # λ, weight of the area term against the shape term
POSITIVE_DETERMINANT = 1e-9  # determinant above which a face counts as upright


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
    return ~(left - right > 1e-15 * (np.abs(left) + np.abs(right)))


def flips(cut_mesh: CutMesh, uv: FloatArray) -> IntArray:
    """(n_charts,) how many faces of each chart are flipped."""
    return group_count(cut_mesh.chart[flipped(cut_mesh.faces, uv)], cut_mesh.n_charts)


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
    before, bad = flips(cut_mesh, uv), flipped(cut_mesh.faces, uv)
    widest, tried, last = 0, 0, np.zeros_like(bad)
    uv = uv.copy()
    touched = np.zeros(len(cut_mesh.faces), bool)
    for rings in CONFORMAL_RINGS if conformal else FEW_FLIPS_RINGS if near else USUAL_RINGS:
        if not bad.any() or (monitor is not None and monitor.expired):
            break
        widest = rings
        region = grow(cut_mesh, bad, rings)
        if np.array_equal(bad, last) and region.sum() <= HARDLY_RATIO * tried:
            continue  # a larger region of equal faces would fail again
        last, tried = bad, int(region.sum())
        touched |= region
        part = moving_region(cut_mesh, region, hold, uv)
        x = lower(part, uv[part.source], monitor)
        # a region is kept only where it has fewer flips than before: the next one starts from the better map
        fewer = flips(part.cut_mesh, x) < flips(part.cut_mesh, uv[part.source])
        keep = fewer[part.cut_mesh.vertex_chart] & ~part.fixed
        uv[part.source[keep]] = x[keep]
        bad = flipped(cut_mesh.faces, uv)
    if touched.any():
        uv = _polished(cut_mesh, uv, touched, hold, 1.0 if conformal else 0.0)
    return uv, UntangleReport(before, flips(cut_mesh, uv), widest)


def _polished(
    cut_mesh: CutMesh, uv: FloatArray, touched: BoolArray, hold: BoolArray, blend: float
) -> FloatArray:
    """A few Newton steps where faces have moved: untangling leaves them upright, and the steps restore their
    shape. Groups with a flipped face do not change."""
    part = moving_region(cut_mesh, touched, hold, uv)
    if part.fixed.all():
        return uv
    options = RelaxOptions(
        tolerance=1e-3, max_iterations=POLISH_STEPS, fixed=part.fixed, blend=blend
    )
    out, moved = uv.copy(), ~part.fixed
    out[part.source[moved]] = relax(part.cut_mesh, uv[part.source], options).uv[moved]
    return out


class FoldoverEnergy:
    """The energy of the groups of a region, Σ A (tr JᵀJ + λ (D² + 1)) / χ(D) over Σ A. Here D = det J and χ(D)
    = (D + √(ε² + D²)) / 2. epsilon: (n_charts,) the ε of each.

    Arrays have their components first, (2, 2, m), so that every operation runs over contiguous faces.
    """

    def __init__(self, region: Region, epsilon: FloatArray) -> None:
        part = self.cut_mesh = region.cut_mesh
        self.fixed, self.epsilon = region.fixed, epsilon[part.chart]
        self.corners = part.faces.T.copy()
        self.gradients = np.ascontiguousarray(part.gradients.transpose(1, 2, 0))  # (2, corner, m)
        self.weight = part.areas / part.chart_areas[part.chart]

    def jacobian(self, x: FloatArray) -> FloatArray:
        """(2, 2, m), from differences."""
        # in rows: indices of a transposed array would make columns, which are slow to work with
        return dirichlet.jacobians(self.gradients, np.take(x.T, self.corners, axis=1))

    def determinants(self, x: FloatArray) -> FloatArray:
        """(m,) determinant of the Jacobian of each face."""
        return dirichlet.determinants(self.jacobian(x))

    def barrier(self, det: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(χ, √(ε² + D²)); ε²/(√ − D)/2 is χ without cancellation where D < 0."""
        root = np.sqrt(self.epsilon**2 + det**2)
        chi = np.where(det >= 0, det + root, self.epsilon**2 / (root - np.minimum(det, 0)))
        return chi / 2, root

    # a trial step may leave the range of floats; its infinite energy refuses it
    @np.errstate(over="ignore", divide="ignore", invalid="ignore")
    def energy(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Energies of the groups and the gradient."""
        j = self.jacobian(x)
        (a, b), (c, d) = j
        det = a * d - b * c
        chi, root = self.barrier(det)
        top = a * a + b * b + c * c + d * d + AREA_WEIGHT * (det**2 + 1)
        value = group_sum(self.weight * top / chi, self.cut_mesh.chart, self.cut_mesh.n_charts)
        by_det = (2 * AREA_WEIGHT * det - top / root) * self.weight / chi  # χ' = χ/√
        scale = 2 * self.weight / chi
        stress = scale * j
        stress[0, 0] += by_det * d
        stress[0, 1] -= by_det * c
        stress[1, 0] -= by_det * b
        stress[1, 1] += by_det * a
        g = self.gradients
        corner = stress[:, 0, None] * g[0] + stress[:, 1, None] * g[1]  # (uv, corner, m)
        out = group_sum(corner.reshape(2, -1).T, self.corners.ravel(), len(x))
        out[self.fixed] = 0.0
        return value, out

    def start_matrix(self, x: FloatArray) -> HeldFactor:
        """Factor of Σ A/χ gᵀg on the moving vertices: the part of the Hessian that is always positive."""
        chi, _ = self.barrier(self.determinants(x))
        weight = self.weight / np.maximum(chi, 1e-3)
        g = self.gradients
        blocks = (g[0][:, None] * g[0][None] + g[1][:, None] * g[1][None]) * weight
        rows, columns = np.broadcast_arrays(self.corners[:, None], self.corners[None])
        n = len(x)
        matrix = sps.csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))
        diagonal = matrix.diagonal()
        ridge = 1e-8 * diagonal + 1e-12 * float(diagonal[~self.fixed].mean())
        return HeldFactor(matrix + sps.diags(ridge), self.fixed)


def lower(region: Region, x: FloatArray, monitor: Monitor | None) -> FloatArray:
    """(n, 2) the layout x of a region, lowered with an ε that follows the worst determinant of each group.

    A group is done when all its faces are upright; until then ε² = 10⁻¹² + 0.04 min(D, 0)² (Garanzha et al.
    2021). A group that diverges or stops improving is given up.
    """
    out = x.copy()
    source = np.arange(len(x))  # vertices of the remaining groups
    moving = np.ones(region.cut_mesh.n_charts, bool)
    # flips, and how far the worst face is from upright
    best = np.full((2, len(moving)), np.inf)
    barren = np.zeros(len(moving), np.int64)
    for _ in range(OUTER_ROUNDS):
        group, n = region.cut_mesh.chart, region.cut_mesh.n_charts
        determinant = FoldoverEnergy(region, np.ones(n)).determinants(x)
        worst = group_min(determinant, group, n)
        wrong = group_count(group[determinant <= POSITIVE_DETERMINANT], n)
        now = np.stack([wrong, -worst])
        barren = np.where((now < BETTER * best).any(0), 0, barren + 1)
        best = np.minimum(best, now)
        # a diverging group is given up before its numbers overflow
        low, high = group_boxes(x, region.cut_mesh.vertex_chart, n)
        near = (high - low).max(1) <= FAR_ROOTS * np.sqrt(region.cut_mesh.chart_areas)
        left = (worst <= POSITIVE_DETERMINANT) & near
        # without a lower step now, the next round has none either
        left &= moving & (barren < BARREN)
        if not left.any() or (monitor is not None and monitor.expired):
            break
        if not left.all():
            region, vertices = region.groups(left)
            x, worst, source = x[vertices], worst[left], source[vertices]
            best, barren = best[:, left], barren[left]
        energy = FoldoverEnergy(region, np.sqrt(1e-12 + 0.04 * np.minimum(worst, 0.0) ** 2))
        groups = Groups(region.cut_mesh.vertex_chart, region.cut_mesh.n_charts)
        found = descend(energy.energy, x, groups, energy.start_matrix(x).solve, DESCENT)
        out[source], moving = found.x, found.steps > 0
        x = found.x
        if monitor is not None:
            monitor.note(f"{int(left.sum())} regions to untangle")
    return out
