"""Lay charts out from the Jacobians their faces should have, by one linear solve for all charts."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import first_of_each, group_sum, mask_of, next_half_edge, slices
from circparam.core.linalg import Factor, HeldFactor
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet
from circparam.solvers.pattern import pattern_of


def laplacian(cut_mesh: CutMesh) -> sps.csr_matrix:
    """(nv, nv) cotangent Laplacian of all charts, positive semidefinite, from the rest triangles alone."""
    g = cut_mesh.gradients
    weight = -(g * g[:, :, [1, 2, 0]]).sum(1) * cut_mesh.areas[:, None]  # of half-edge 3f + k
    flat = cut_mesh.faces.ravel()
    h = np.arange(len(flat))
    tail, head, w = flat, flat[next_half_edge(h)], weight.ravel()
    n = cut_mesh.n_vertices
    off = sps.coo_matrix(
        (np.concatenate([-w, -w]), (np.concatenate([tail, head]), np.concatenate([head, tail]))),
        shape=(n, n),
    )
    diagonal = group_sum(np.concatenate([w, w]), np.concatenate([tail, head]), n)
    return (off + sps.diags(diagonal)).tocsr()


def from_jacobians(
    cut_mesh: CutMesh,
    targets: FloatArray,
    untangle: int = 0,
    held: tuple[IntArray, FloatArray] | None = None,
) -> tuple[FloatArray, BoolArray]:
    """The layout u that minimises Σ area |J(u) − target|², and which charts are free of flips.

    targets: (2, 2, m). untangle: largest number of rounds for charts with flipped faces. A round clamps the
    singular values of their Jacobians to [½, 2], as a rotation times a stretch. It then solves again with the
    same factor (the local/global method of Liu and others 2008). held: vertices (k,) of every chart and their
    places (k, 2), which untangling does not hold; None: the first vertex of every chart lies at the origin.
    Returns (uv (nv, 2), (n_charts,) bool: no face flipped).
    """
    solver = Poisson(cut_mesh, held)
    uv = solver.layout(targets)
    jacobian, flipped = solver.judged(uv)
    if not (untangle and flipped.any()):
        return uv, ~flipped
    part, vertices, faces = cut_mesh.subset(flipped)
    if part is not cut_mesh:
        solver, jacobian = Poisson(part), jacobian[:, :, faces]
    left = np.ones(part.n_charts, bool)
    wanted, out = np.zeros_like(jacobian), uv[vertices]
    for _ in range(untangle):
        again = left[part.chart]
        wanted[:, :, again] = clamp_stretch(jacobian[:, :, again], 0.5)
        out = np.where(left[part.vertex_chart][:, None], solver.layout(wanted), out)
        jacobian, found = solver.judged(out)
        left &= found
        if not left.any():
            break
    uv[vertices], flipped[flipped] = out, left
    return uv, ~flipped


def divergence(cut_mesh: CutMesh, gradients: FloatArray, targets: FloatArray) -> FloatArray:
    """(nv, 2) the Laplacian of the layout with these Jacobians (2, 2, m); gradients: (2, 3, m)."""
    n, flat = cut_mesh.n_vertices, cut_mesh.faces.T.ravel()
    corner = np.empty((2, 3, len(cut_mesh.faces)))
    for k in slices(len(cut_mesh.faces)):
        flux, g = targets[..., k] * cut_mesh.areas[k], gradients[..., k]
        corner[..., k] = flux[:, 0, None] * g[0] + flux[:, 1, None] * g[1]
    return group_sum(corner.reshape(2, -1).T, flat, n)


class Poisson:
    """The system of ``from_jacobians``, factored once. held: as there."""

    def __init__(self, cut_mesh: CutMesh, held: tuple[IntArray, FloatArray] | None = None) -> None:
        self.cut_mesh, self.held = cut_mesh, held
        self.gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
        self.corners = cut_mesh.faces.T.copy()
        n = cut_mesh.n_vertices
        if held is not None:
            self.held_factor = HeldFactor(laplacian(cut_mesh), held[0])
            return
        g = self.gradients
        weight = -(g * g[:, [1, 2, 0]]).sum(0) * cut_mesh.areas
        self.pattern = pattern_of(cut_mesh)
        # the energy is invariant under motions of a chart: a spring at one vertex fixes its position
        pins = np.zeros(n)
        self.pins = first_of_each(cut_mesh.vertex_chart, cut_mesh.n_charts)
        ahead = [1, 2, 0]
        around = group_sum(
            np.abs(np.concatenate([weight.ravel(), weight.ravel()])),
            np.concatenate([self.corners.ravel(), self.corners[ahead].ravel()]),
            n,
        )
        pins[self.pins] = around[self.pins]
        self.factor = Factor(self.pattern.numbers(weight.ravel(), pins), self.pattern.ordered)
        if not self.pattern.ordered:
            cut_mesh.eliminated_in(self.pattern.elimination(self.factor, 1))

    def layout(self, targets: FloatArray) -> FloatArray:
        """(nv, 2) the layout for these Jacobians (2, 2, m)."""
        right = divergence(self.cut_mesh, self.gradients, targets)
        if self.held is not None:
            return self.held_factor.solve(right, self.held[1])
        order, uv = self.pattern.order, np.empty_like(right)
        uv[order] = self.factor.solve(right[order])
        return uv - uv[self.pins][self.cut_mesh.vertex_chart]

    def judged(self, uv: FloatArray) -> tuple[FloatArray, BoolArray]:
        """(Jacobians (2, 2, m), (n_charts,) bool: a face is flipped)."""
        jacobian = dirichlet.jacobians(self.gradients, uv.T[:, self.corners])
        turned = ~(dirichlet.determinants(jacobian) > 0)
        return jacobian, mask_of(self.cut_mesh.n_charts, self.cut_mesh.chart[turned])


def clamp_stretch(jacobian: FloatArray, low: float) -> FloatArray:
    """Each J (2, 2, m) with its signed singular values clamped to [low, 1/low]: never flipped afterwards."""
    (a, b), (c, d) = jacobian
    e, f, g, h = (a + d) / 2, (a - d) / 2, (c + b) / 2, (c - b) / 2
    q, r = np.hypot(e, h), np.hypot(f, g)
    s1, s2 = np.clip(q + r, low, 1 / low), np.clip(q - r, low, 1 / low)
    # a pure reflection has no rotation to scale, a similarity no reflection
    with np.errstate(all="ignore"):
        turn, bend = (s1 + s2) / 2 / q, (s1 - s2) / 2 / r
        e, h = np.where(q > 0, e * turn, (s1 + s2) / 2), np.where(q > 0, h * turn, 0.0)
        f, g = np.where(r > 0, f * bend, 0.0), np.where(r > 0, g * bend, 0.0)
    return np.stack([np.stack([e + f, g - h]), np.stack([g + h, e - f])])
