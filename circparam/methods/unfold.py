"""Turn flipped faces back: the foldover-free energy (Garanzha et al. 2021) on small regions round them.

All regions of all charts are one problem. A region grows, up to its whole chart, until it comes out free of
flips; vertices on its rim keep their places, so that the rest of the map stays as it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sps
import scipy.sparse.csgraph as csgraph

from circparam.arrays import BoolArray, FloatArray, IntArray, group_min, group_sum
from circparam.geometry import signed_areas
from circparam.linear import Factor
from circparam.mesh import Patches
from circparam.methods.base import MethodOptions
from circparam.methods.descent import descend
from circparam.progress import Monitor

RINGS = (2, 5, 12, 30, 10**9)  # width of the region round a flipped face, tried in turn
OUTER = 25
INNER = 60
AREA = 1.0  # weight of the area term against the shape term
THINNEST = 0.02  # a reference triangle is at least so high, as a share of its longest edge


@dataclass(frozen=True, eq=False)
class UnfoldReport:
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


def unfold(
    patches: Patches,
    uv: FloatArray,
    hold: BoolArray | None = None,
    monitor: Monitor | None = None,
) -> tuple[FloatArray, UnfoldReport]:
    """A layout near ``uv`` without flipped faces, where the energy finds one.

    uv: (n_vertices, 2). hold: (n_vertices,) vertices that keep their places (none by default). Charts without
    flips are returned as they are. Returns (uv, report); the input is not changed.
    """
    hold = np.zeros(patches.n_vertices, bool) if hold is None else hold
    n = patches.n_charts
    bad = flipped(patches.faces, uv)
    before = np.bincount(patches.chart[bad], minlength=n)
    widest = 0
    uv = uv.copy()
    for rings in RINGS:
        if not bad.any() or (monitor is not None and monitor.expired):
            break
        widest = rings
        region = _grow(patches, bad, rings)
        new = _solve_region(patches, uv, region, hold, monitor)
        # keep a region only where it has fewer flips than before: the next one starts from the better map
        now = flipped(patches.faces, new)
        better = np.bincount(patches.chart[now], minlength=n) <= np.bincount(
            patches.chart[bad], minlength=n
        )
        uv = np.where(better[patches.vertex_chart][:, None], new, uv)
        bad = flipped(patches.faces, uv)
        if (region | ~bad[:]).all() and rings >= RINGS[-1]:
            break
    return uv, UnfoldReport(before, np.bincount(patches.chart[bad], minlength=n), widest)


def _grow(patches: Patches, seed: BoolArray, rings: int) -> BoolArray:
    """(m,) faces within so many vertex rings of the seed faces; whole charts for a huge number."""
    if rings >= RINGS[-1]:
        touched = np.zeros(patches.n_charts, bool)
        touched[patches.chart[seed]] = True
        return touched[patches.chart]
    region = seed
    for _ in range(rings):
        near = np.zeros(patches.n_vertices, bool)
        near[patches.faces[region]] = True
        region = near[patches.faces].any(1)
    return region


def _solve_region(
    patches: Patches, uv: FloatArray, region: BoolArray, hold: BoolArray, monitor: Monitor | None
) -> FloatArray:
    """Minimise the energy of the faces of a region, with its rim and the held vertices fixed."""
    outside = np.zeros(patches.n_vertices, bool)
    outside[patches.faces[~region]] = True
    vertices, local = np.unique(patches.faces[region], return_inverse=True)
    faces = local.reshape(-1, 3)
    fixed = (outside | hold)[vertices]
    group, n = _components(faces, fixed, len(vertices))
    face_group = group[faces].max(1)  # held vertices have group −1
    use = face_group >= 0
    faces, face_group = faces[use], face_group[use]
    frames = _reference(patches.frames[region][use])
    # centred for the digits; scaled so that a face of mean size has determinant 1
    x = uv[vertices] - uv[vertices].mean(0)
    signed = group_sum(signed_areas(faces, x), face_group, n)
    size = group_sum(np.abs(signed_areas(faces, x)), face_group, n)
    reference = group_sum(_areas(frames), face_group, n)
    wanted = np.where(signed > 0.05 * size, signed, size)
    frames = frames * np.sqrt(np.maximum(wanted, 1e-300) / reference)[face_group][:, None, None]
    problem = _Problem(
        faces, face_group, n, frames, np.where(fixed, 0, np.maximum(group, 0)), fixed
    )
    new = problem.minimise(x, monitor)
    out = uv.copy()
    moved = ~fixed
    out[vertices[moved]] = uv[vertices[moved]] + (new[moved] - x[moved])
    return out


def _components(faces: IntArray, fixed: BoolArray, n: int) -> tuple[IntArray, int]:
    """Group of every vertex that may move (−1 for the others): those joined by faces move together."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    # two moving vertices of a face belong together even where the third is held
    pairs = np.concatenate([pairs, faces[:, [2, 0]]])
    pairs = pairs[~fixed[pairs].any(1)]
    graph = sps.coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, labels = csgraph.connected_components(graph, directed=False)
    group = np.full(n, -1)
    values, group[~fixed] = np.unique(labels[~fixed], return_inverse=True)
    return group, len(values)


def _areas(frames: FloatArray) -> FloatArray:
    """(m,) areas of triangles in the plane."""
    d, e = frames[:, 1] - frames[:, 0], frames[:, 2] - frames[:, 0]
    return (d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]) / 2


def _reference(frames: FloatArray) -> FloatArray:
    """Triangles with needles and caps raised to a least height: only their sign matters here, and their
    gradients would swamp all others."""
    sides = frames[:, [1, 2, 0]] - frames
    length = np.sqrt((sides**2).sum(2))
    longest = length.max(1)
    height = 2 * _areas(frames) / longest
    thin = height < THINNEST * longest
    out = frames.copy()
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
    """The foldover-free energy of some faces: Σ A (tr JᵀJ + λ(det² + 1)) / χ(det), χ = (D + √(ε² + D²))/2."""

    def __init__(
        self,
        faces: IntArray,
        face_group: IntArray,
        n: int,
        frames: FloatArray,
        group: IntArray,
        fixed: BoolArray,
    ) -> None:
        self.faces, self.face_group, self.n = faces, face_group, n
        self.group, self.fixed = group, fixed
        area = _areas(frames)
        opposite = frames[:, [2, 0, 1]] - frames[:, [1, 2, 0]]
        turned = np.stack([-opposite[..., 1], opposite[..., 0]], 2)
        self.gradients = turned / (2 * area)[:, None, None]  # (m, corner, 2)
        total = group_sum(area, face_group, n)
        self.weight = area / total[face_group]
        self.epsilon = np.ones(n)

    def jacobian(self, x: FloatArray) -> FloatArray:
        """(m, 2, 2), from differences."""
        p = x[self.faces]
        g = self.gradients
        d, e = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
        return d[:, :, None] * g[:, None, 1] + e[:, :, None] * g[:, None, 2]

    def energy(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Energies of the groups and the gradient."""
        j = self.jacobian(x)
        det = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
        trace = (j * j).sum((1, 2))
        root = np.sqrt(self.epsilon[self.face_group] ** 2 + det**2)
        # ε²/(√ − D)/2 is the same number without cancellation where D < 0
        chi = np.where(
            det >= 0, det + root, self.epsilon[self.face_group] ** 2 / (root - np.minimum(det, 0))
        )
        chi = chi / 2
        top = trace + AREA * (det**2 + 1)
        value = group_sum(self.weight * top / chi, self.face_group, self.n)
        slope = chi / root  # χ' = (1 + D/√)/2
        adjugate = np.empty_like(j)
        adjugate[:, 0, 0], adjugate[:, 1, 1] = j[:, 1, 1], j[:, 0, 0]
        adjugate[:, 0, 1], adjugate[:, 1, 0] = -j[:, 1, 0], -j[:, 0, 1]
        by_det = (2 * AREA * det - top * slope / chi) / chi
        stress = 2 * j / chi[:, None, None] + by_det[:, None, None] * adjugate
        stress *= self.weight[:, None, None]
        corner = np.einsum("mij,mkj->mki", stress, self.gradients).reshape(-1, 2)
        flat = self.faces.ravel()
        out = np.stack([group_sum(np.ascontiguousarray(c), flat, len(x)) for c in corner.T], 1)
        out[self.fixed] = 0.0
        return value, out

    def start_matrix(self, x: FloatArray) -> Factor:
        """Factor of Σ A/χ gᵀg on the moving vertices: the part of the Hessian that is always positive."""
        j = self.jacobian(x)
        det = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
        eps = self.epsilon[self.face_group]
        chi = np.maximum((det + np.sqrt(eps**2 + det**2)) / 2, 1e-2 * eps)
        weight = self.weight / np.maximum(chi, 1e-3)
        blocks = np.einsum("mki,mli->mkl", self.gradients, self.gradients) * weight[:, None, None]
        rows = np.repeat(self.faces, 3, axis=1).ravel()
        columns = np.tile(self.faces, (1, 3)).ravel()
        nv = len(x)
        matrix = sps.csr_matrix((blocks.ravel(), (rows, columns)), shape=(nv, nv))
        move = np.flatnonzero(~self.fixed)
        matrix = matrix[move][:, move]
        ridge = 1e-8 * matrix.diagonal() + 1e-12 * float(matrix.diagonal().mean())
        return Factor(sps.csc_matrix(matrix + sps.diags(ridge)))

    def minimise(self, x: FloatArray, monitor: Monitor | None) -> FloatArray:
        """Lower ε with the worst determinant until all are positive."""
        move = np.flatnonzero(~self.fixed)
        good_once = np.zeros(self.n, bool)
        best = x
        for _ in range(OUTER):
            j = self.jacobian(x)
            det = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
            worst = group_min(det, self.face_group, self.n)
            good = worst > 0
            best = np.where((good | ~good_once)[self.group][:, None], x, best)
            if (good & good_once).all():  # one round more after the first good one, for some margin
                break
            good_once |= good
            self.epsilon = np.sqrt(1e-12 + 0.04 * np.minimum(worst, 0.0) ** 2)
            factor = self.start_matrix(x)

            def precondition(g: FloatArray, factor: Factor = factor) -> FloatArray:
                out = np.zeros_like(g)
                out[move] = factor.solve(g[move])
                return out

            x, _, _ = descend(
                self.energy, x, self.group, self.n, precondition, 1e-4, INNER, monitor=None
            )
            if monitor is not None and monitor.expired:
                break
        j = self.jacobian(x)
        det = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
        good = group_min(det, self.face_group, self.n) > 0
        return np.where((good | ~good_once)[self.group][:, None], x, best)


def mend(
    patches: Patches,
    uv: FloatArray,
    name: str,
    options: MethodOptions,
    monitor: Monitor,
    hold: BoolArray | None = None,
) -> tuple[FloatArray, list[str]]:
    """Unfold what a method without a guarantee has flipped, and say so in one line.

    Returns (uv, notes). With ``options.repair`` off the flips stay, and are told.
    """
    bad = flipped(patches.faces, uv)
    if not bad.any():
        return uv, []
    charts = len(np.unique(patches.chart[bad]))
    count = f"{name}: {int(bad.sum())} flipped faces in {charts} charts"
    if not options.repair:
        return uv, [f"{count}; they stay, as asked"]
    with monitor.stage("unfold"):
        uv, report = unfold(patches, uv, hold, monitor)
    left = int(report.after.sum())
    if left == 0:
        return uv, [f"{count}, mended by the foldover-free energy"]
    return uv, [f"{count}, mended by the foldover-free energy but for {left} faces"]
