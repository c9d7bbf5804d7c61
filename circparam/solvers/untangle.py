"""Turn flipped faces back: the foldover-free energy (Garanzha et al. 2021) on small regions round them.

All regions of all charts are one problem. A region grows, up to its whole chart, until it comes out free of
flips; vertices on its rim keep their places, so that the rest of the map stays as it was.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_max, group_min, group_sum
from circparam.core.graph import components
from circparam.core.linalg import Factor
from circparam.core.monitor import Monitor
from circparam.geometry.intrinsic import signed_areas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import corner_classes
from circparam.solvers.lbfgs import descend
from circparam.solvers.newton import RelaxOptions, relax

WHOLE = 10**9

# Widths of the region round a flipped face, tried in turn. A wide one leaves room for shape; a map whose scale
# varies much, as conformal ones do, is kept best by a narrow one.
RINGS = (8, 3, 20, WHOLE)
NARROW_RINGS = (2, 5, 12, 30, WHOLE)
OUTER = 25
FAR = 1e4  # times the root of its area: a group that spreads so wide is not followed further
INNER = 60
POLISH = 10  # Newton steps on what was untangled, for its shape
AREA = 1.0  # weight of the area term against the shape term
THINNEST = 0.02  # a reference triangle is at least so high, as a share of its longest edge


@dataclass(frozen=True, eq=False)
class UntangleReport:
    """before, after (n_charts,): flipped faces of each chart. rings: widest region that was needed."""

    before: IntArray
    after: IntArray
    rings: int


def flipped(faces: IntArray, uv: FloatArray) -> BoolArray:
    """(m,) the face is turned or collapsed, or too thin for its sign to be certain in floating point."""
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
) -> tuple[FloatArray, UntangleReport]:
    """A layout near ``uv`` without flipped faces, where the energy finds one.

    uv: (n_vertices, 2). hold: (n_vertices,) vertices that keep their places (none by default). Charts without
    flips are returned as they are. conformal: the map keeps angles rather than areas. Returns (uv, report);
    the input is not changed.
    """
    hold = np.zeros(cut_mesh.n_vertices, bool) if hold is None else hold
    n = cut_mesh.n_charts
    first = bad = flipped(cut_mesh.faces, uv)
    widest = 0
    uv = uv.copy()
    touched = np.zeros(len(cut_mesh.faces), bool)
    for rings in NARROW_RINGS if conformal else RINGS:
        if not bad.any() or (monitor is not None and monitor.expired):
            break
        widest = rings
        region = _grow(cut_mesh, bad, rings)
        touched |= region
        part = _region(cut_mesh, region, hold, uv)
        x = _lowest(part, uv[part.source], monitor)
        # a region is kept only where it has fewer flips than before: the next one starts from the better map
        now = np.bincount(part.chart[flipped(part.faces, x)], minlength=part.n)
        old = np.bincount(part.chart[flipped(part.faces, uv[part.source])], minlength=part.n)
        keep = (now < old)[part.cut_mesh.vertex_chart] & ~part.fixed
        uv[part.source[keep]] = x[keep]
        bad = flipped(cut_mesh.faces, uv)
    if touched.any():
        uv = _polished(cut_mesh, uv, touched, hold, 1.0 if conformal else 0.0)
        bad = flipped(cut_mesh.faces, uv)
    count = [np.bincount(cut_mesh.chart[b], minlength=n) for b in (first, bad)]
    return uv, UntangleReport(count[0], count[1], widest)


def _grow(cut_mesh: CutMesh, seed: BoolArray, rings: int) -> BoolArray:
    """(m,) faces within so many vertex rings of the seed faces; whole charts for a huge number."""
    if rings >= WHOLE:
        touched = np.zeros(cut_mesh.n_charts, bool)
        touched[cut_mesh.chart[seed]] = True
        return touched[cut_mesh.chart]
    region = seed
    for _ in range(rings):
        near = np.zeros(cut_mesh.n_vertices, bool)
        near[cut_mesh.faces[region]] = True
        region = np.asarray(near[cut_mesh.faces].any(1))
    return region


@dataclass(frozen=True, eq=False)
class _Part:
    """Faces that move together, as cut mesh of their own: one chart for each group of moving vertices.

    source: vertex of the whole that each vertex is. fixed: it keeps its place (such a vertex may occur in
    several groups). The rest triangles are scaled so that a face of mean size has the area it has in the
    layout.
    """

    cut_mesh: CutMesh
    source: IntArray
    fixed: BoolArray

    @property
    def faces(self) -> IntArray:
        """Faces of the part."""
        return self.cut_mesh.faces

    @property
    def chart(self) -> IntArray:
        """Group of each face."""
        return self.cut_mesh.chart

    @property
    def n(self) -> int:
        """Number of groups."""
        return self.cut_mesh.n_charts

    def groups(self, keep: BoolArray) -> tuple[_Part, IntArray]:
        """Some groups only, and which vertex of this part each of theirs is."""
        cut_mesh, vertices, _ = self.cut_mesh.subset(keep)
        return _Part(cut_mesh, self.source[vertices], self.fixed[vertices]), vertices


def cut_out(
    cut_mesh: CutMesh, region: BoolArray, hold: BoolArray
) -> tuple[CutMesh, IntArray, BoolArray]:
    """The faces of a region ((m,) bool) as cut mesh, one chart for each group of vertices that move together.

    hold: (n_vertices,) vertices that keep their places; so do those of faces outside the region. Returns
    (cut mesh, (k,) vertex of the whole that each vertex is, (k,) bool: it keeps its place).
    """
    fixed = hold.copy()
    fixed[cut_mesh.faces[~region]] = True
    region = region & ~fixed[cut_mesh.faces].all(1)
    fid = np.flatnonzero(region)
    label = _moving_groups(cut_mesh.faces[fid], fixed, cut_mesh.n_vertices)
    chart = label[cut_mesh.faces[fid]].max(1)  # fixed vertices have label −1
    _, chart = np.unique(chart, return_inverse=True)
    local = np.full(len(cut_mesh.faces), -1)
    local[fid] = np.arange(len(fid))
    i, j = cut_mesh.edges[:, 0], cut_mesh.edges[:, 1]
    both = region[i // 3] & region[j // 3]
    edges = 3 * local[cut_mesh.edges[both] // 3] + cut_mesh.edges[both] % 3
    edges = edges[chart[edges[:, 0] // 3] == chart[edges[:, 1] // 3]]
    n, faces = corner_classes(len(fid), edges)
    source = np.empty(n, np.int64)
    source[faces.ravel()] = cut_mesh.faces[fid].ravel()
    return CutMesh(faces, cut_mesh.rest_triangles[fid], chart, edges), source, fixed[source]


def _region(cut_mesh: CutMesh, region: BoolArray, hold: BoolArray, uv: FloatArray) -> _Part:
    """The part of a region: vertices of faces outside it and held ones are fixed."""
    cut, source, fixed = cut_out(cut_mesh, region, hold)
    part = replace(cut, rest_triangles=_reference(cut.rest_triangles))
    area = signed_areas(part.faces, uv[source])
    signed = group_sum(area, part.chart, part.n_charts)
    size = group_sum(np.abs(area), part.chart, part.n_charts)
    # what the rim encloses is what the faces will share, unless the rim itself is folded
    wanted = np.where(signed > 0.05 * size, signed, size)
    scale = np.sqrt(np.maximum(wanted, 1e-300) / part.chart_areas)
    scaled = replace(part, rest_triangles=part.rest_triangles * scale[part.chart][:, None, None])
    return _Part(scaled, source, fixed)


def _moving_groups(faces: IntArray, fixed: BoolArray, n: int) -> IntArray:
    """(n,) label of every vertex that may move (−1 for the others): those joined by faces move together."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    pairs = pairs[~fixed[pairs].any(1)]
    return np.where(fixed, -1, components(n, pairs[:, 0], pairs[:, 1])[1])


def _areas(rest_triangles: FloatArray) -> FloatArray:
    """(m,) areas of triangles in the plane."""
    d, e = rest_triangles[:, 1] - rest_triangles[:, 0], rest_triangles[:, 2] - rest_triangles[:, 0]
    return (d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]) / 2


def _reference(rest_triangles: FloatArray) -> FloatArray:
    """Triangles with needles and caps raised to a least height: only their sign matters here, and their
    gradients would swamp all others."""
    sides = rest_triangles[:, [1, 2, 0]] - rest_triangles
    length = np.sqrt((sides**2).sum(2))
    longest = length.max(1)
    height = 2 * _areas(rest_triangles) / longest
    thin = height < THINNEST * longest
    out = rest_triangles.copy()
    if thin.any():
        # over its longest side, the opposite corner straight above the middle
        k = length[thin].argmax(1)
        rows = np.flatnonzero(thin)
        zero = np.zeros(len(rows))
        out[rows, k] = np.stack([zero, zero], 1)
        out[rows, (k + 1) % 3] = np.stack([longest[thin], zero], 1)
        out[rows, (k + 2) % 3] = np.stack([longest[thin] / 2, THINNEST * longest[thin]], 1)
    return out


class _Problem:
    """The foldover-free energy of a part: Σ A (tr JᵀJ + λ(det² + 1)) / χ(det), χ = (D + √(ε² + D²))/2.

    Arrays have their components first, (2, 2, m), so that every operation runs over contiguous faces.
    """

    def __init__(self, part: _Part, epsilon: FloatArray) -> None:
        p = part.cut_mesh
        self.part, self.epsilon = part, epsilon[p.chart]
        self.gradients = np.ascontiguousarray(p.gradients.transpose(1, 2, 0))  # (2, corner, m)
        self.weight = p.areas / p.chart_areas[p.chart]
        m = len(p.faces)
        self.scatter = sps.csr_matrix(
            (np.ones(3 * m), (p.faces.T.ravel(), np.arange(3 * m))), shape=(p.n_vertices, 3 * m)
        )

    def jacobian(self, x: FloatArray) -> FloatArray:
        """(2, 2, m), from differences."""
        f, g = self.part.faces, self.gradients
        origin = x[f[:, 0]]
        d, e = (x[f[:, 1]] - origin).T, (x[f[:, 2]] - origin).T
        result: FloatArray = d[:, None] * g[None, :, 1] + e[:, None] * g[None, :, 2]
        return result

    def determinants(self, x: FloatArray) -> FloatArray:
        """(m,) determinant of the Jacobian of each face."""
        j = self.jacobian(x)
        result: FloatArray = j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]
        return result

    def barrier(self, det: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(χ, √(ε² + D²)); ε²/(√ − D)/2 is χ without cancellation where D < 0."""
        root = np.sqrt(self.epsilon**2 + det**2)
        chi = np.where(det >= 0, det + root, self.epsilon**2 / (root - np.minimum(det, 0)))
        return chi / 2, root

    def energy(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Energies of the groups and the gradient."""
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            # a trial step may leave the range of floats; its infinite energy refuses it
            return self._energy(x)

    def _energy(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        j = self.jacobian(x)
        (a, b), (c, d) = j
        det = a * d - b * c
        chi, root = self.barrier(det)
        top = a * a + b * b + c * c + d * d + AREA * (det**2 + 1)
        value = group_sum(self.weight * top / chi, self.part.chart, self.part.n)
        by_det = (2 * AREA * det - top / root) * self.weight / chi  # χ' = χ/√
        scale = 2 * self.weight / chi
        stress = scale * j
        stress[0, 0] += by_det * d
        stress[0, 1] -= by_det * c
        stress[1, 0] -= by_det * b
        stress[1, 1] += by_det * a
        g = self.gradients
        corner = stress[:, 0, None] * g[0] + stress[:, 1, None] * g[1]  # (uv, corner, m)
        out: FloatArray = self.scatter @ corner.reshape(2, -1).T
        out[self.part.fixed] = 0.0
        return value, out

    def start_matrix(self, x: FloatArray) -> tuple[Factor, IntArray]:
        """Factor of Σ A/χ gᵀg on the moving vertices: the part of the Hessian that is always positive."""
        chi, _ = self.barrier(self.determinants(x))
        weight = self.weight / np.maximum(chi, 1e-3)
        g = self.gradients
        blocks = (g[0][:, None] * g[0][None] + g[1][:, None] * g[1][None]) * weight
        f = self.part.faces.T
        rows, columns = np.broadcast_arrays(f[:, None], f[None])
        n = len(x)
        matrix = sps.csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))
        move = np.flatnonzero(~self.part.fixed)
        matrix = matrix[move][:, move]
        ridge = 1e-8 * matrix.diagonal() + 1e-12 * float(matrix.diagonal().mean())
        return Factor(sps.csc_matrix(matrix + sps.diags(ridge))), move


def _lowest(part: _Part, x: FloatArray, monitor: Monitor | None) -> FloatArray:
    """Lower ε with the worst determinant of each group until all of its faces are upright."""
    out = x.copy()
    all_vertices = np.arange(len(x))
    moving = np.ones(part.n, bool)
    for _ in range(OUTER):
        problem = _Problem(part, np.ones(part.n))
        worst = group_min(problem.determinants(x), part.chart, part.n)
        # a group that has flown apart is given up, before its numbers overflow
        left = (worst <= 1e-9) & (_extent(part, x) <= FAR * np.sqrt(part.cut_mesh.chart_areas))
        left &= moving  # one that has found no lower step would find none again
        if not left.any() or (monitor is not None and monitor.expired):
            break
        if not left.all():
            part, vertices = part.groups(left)
            x, worst, all_vertices = x[vertices], worst[left], all_vertices[vertices]
        problem = _Problem(part, np.sqrt(1e-12 + 0.04 * np.minimum(worst, 0.0) ** 2))
        factor, move = problem.start_matrix(x)

        def precondition(
            g: FloatArray, factor: Factor = factor, move: IntArray = move
        ) -> FloatArray:
            result = np.zeros_like(g)
            result[move] = factor.solve(g[move])
            return result

        group = part.cut_mesh.vertex_chart
        x, steps, _ = descend(problem.energy, x, group, part.n, precondition, 1e-4, INNER)
        moving = steps > 0
        sound = _extent(part, x) <= FAR * np.sqrt(part.cut_mesh.chart_areas)
        keep = sound[group]
        out[all_vertices[keep]] = x[keep]
        if monitor is not None:
            monitor.update(0.5, f"{int(left.sum())} regions to untangle")
    return out


def _extent(part: _Part, x: FloatArray) -> FloatArray:
    """(n,) width or height of the layout of each group."""
    group = part.cut_mesh.vertex_chart
    spread = [
        group_max(x[:, d], group, part.n) - group_min(x[:, d], group, part.n) for d in range(2)
    ]
    return np.maximum(spread[0], spread[1])


def _polished(
    cut_mesh: CutMesh, uv: FloatArray, touched: BoolArray, hold: BoolArray, blend: float
) -> FloatArray:
    """A few Newton steps where faces were moved: untangling leaves them upright, and this gives them back their
    shape. Groups that still hold a flipped face are left alone."""
    part = _region(cut_mesh, touched, hold, uv)
    options = RelaxOptions(tolerance=1e-3, max_iterations=POLISH, fixed=part.fixed, blend=blend)
    x = relax(part.cut_mesh, uv[part.source], options).uv
    out = uv.copy()
    moved = ~part.fixed
    out[part.source[moved]] = x[moved]
    return out
