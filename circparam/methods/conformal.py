"""Shared by the conformal methods: the matrix of Mullen et al. (2008) and its lowest modes."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import ends_of, group_max, group_sum
from circparam.core.linalg import Factor
from circparam.core.types import BoolArray, ComplexArray, FloatArray, IntArray
from circparam.geometry.intrinsic import cotangent_laplacian, signed_areas
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.tutte.outer import outer_boundary

# vectors of the subspace of each chart: eigenvalues come close together on smooth charts
SUBSPACE_MODES = 4
SHIFT_RATIO = 1e-11  # below the smallest eigenvalue that is not zero, above rounding
MOST_ITERATIONS = 60  # of the subspace iteration


def conformal_matrix(cut_mesh: CutMesh) -> sps.csc_matrix:
    """L_C = L + Q, Hermitian positive semidefinite: ½ z* L_C z is the Dirichlet energy minus the area of z.

    Q holds ±i/2 on the boundary half-edges i → j: half the sum of u_i v_j − u_j v_i is the area inside.
    """
    i, j = ends_of(cut_mesh.faces, cut_mesh.boundary)
    n, half = cut_mesh.n_vertices, np.full(len(i), 0.5j)
    area = sps.csr_matrix((np.r_[half, -half], (np.r_[i, j], np.r_[j, i])), shape=(n, n))
    return sps.csc_matrix(cotangent_laplacian(cut_mesh) + area)


def start_modes(cut_mesh: CutMesh) -> ComplexArray:
    """(n, SUBSPACE_MODES) powers of a convex map onto the unit disk: near the first modes of a smooth chart."""
    uv, _ = tutte_embedding(cut_mesh, "mean-value")
    z = uv[:, 0] + 1j * uv[:, 1]
    z = z / np.sqrt(cut_mesh.chart_areas / np.pi)[cut_mesh.vertex_chart]
    return np.stack([z ** (k + 1) for k in range(SUBSPACE_MODES)], 1)


def conformal_spectral(cut_mesh: CutMesh, modes: ComplexArray) -> tuple[ComplexArray, IntArray]:
    """The smallest pair of L_C z = λ B z of every chart, translations taken out; B marks the boundary vertices.

    Subspace iteration on (L_C + shift B)⁻¹ B with a Rayleigh-Ritz step, all charts in one factorisation. On
    developable charts λ = 0 is the answer, so only constants are projected out. modes: (n, k) start vectors.
    Returns (z (n,), steps (n_charts,)).
    """
    matrix = conformal_matrix(cut_mesh)
    chart, n = cut_mesh.vertex_chart, cut_mesh.n_charts
    on_boundary = cut_mesh.on_boundary.astype(np.float64)
    shift = SHIFT_RATIO * float(np.median(matrix.diagonal().real))
    factor = Factor(sps.csc_matrix(matrix + sps.diags(shift * on_boundary)))
    boundary_count = group_sum(on_boundary, chart, n)
    x = modes.copy()
    steps = np.zeros(n, np.int64)
    open_charts = np.ones(n, bool)
    last_move = np.full(n, np.inf)
    for _ in range(MOST_ITERATIONS):
        before = x[:, 0]
        x = factor.solve(on_boundary[:, None] * x)
        x -= (chart_sums(on_boundary[:, None] * x, chart, n) / boundary_count[:, None])[chart]
        x = _rayleigh_ritz(cut_mesh, matrix, on_boundary, x)
        # how far the lowest mode has turned, its free phase taken out
        phase = chart_sums(on_boundary * before.conj() * x[:, 0], chart, n)
        phase = phase / np.maximum(np.abs(phase), 1e-300)
        x[:, 0] *= phase.conj()[chart]
        move = np.sqrt(group_sum(on_boundary * np.abs(x[:, 0] - before) ** 2, chart, n))
        steps += open_charts
        rounding = (move < 1e-6) & (move > 0.7 * last_move)
        open_charts &= ~((move < 1e-10) | rounding)
        last_move = move
        if not open_charts.any():
            break
    return x[:, 0], steps


def chart_sums(values: ComplexArray, chart: IntArray, n: int) -> ComplexArray:
    """(n, ...) sum over each chart of complex values (nv, ...)."""
    vertex = np.arange(len(chart))
    sums = sps.csr_matrix((np.ones(len(chart)), (chart, vertex)), shape=(n, len(chart)))
    out = sums @ values.reshape(len(values), -1)
    return np.asarray(out.reshape(n, *values.shape[1:]), np.complex128)


def _rayleigh_ritz(
    cut_mesh: CutMesh, matrix: sps.csc_matrix, on_boundary: FloatArray, x: ComplexArray
) -> ComplexArray:
    """Rotate the subspace of each chart to its B-normalised Ritz vectors, smallest value first."""
    chart, n, k = cut_mesh.vertex_chart, cut_mesh.n_charts, x.shape[1]
    size = np.sqrt(chart_sums(on_boundary[:, None] * np.abs(x) ** 2 + 0j, chart, n).real)
    x = x / np.maximum(size, 1e-300)[chart]
    bx = on_boundary[:, None] * x
    gram = chart_sums(x.conj()[:, :, None] * bx[:, None, :], chart, n)
    weight, basis = np.linalg.eigh(gram)
    # directions outside the span become zero vectors with a huge value
    keep = weight > 1e-12 * weight[:, -1:]
    basis = np.where(keep, 1 / np.sqrt(np.where(keep, weight, 1.0)), 0.0)[:, None, :] * basis
    x = np.einsum("vk,vkl->vl", x, basis[chart])
    energy = chart_sums(x.conj()[:, :, None] * (matrix @ x)[:, None, :], chart, n)
    big = 1e3 * (1 + np.abs(energy).max((1, 2)))
    energy += np.eye(k) * np.where(keep, 0.0, big[:, None])[:, None, :]
    _, turn = np.linalg.eigh(energy)
    return np.einsum("vk,vkl->vl", x, turn[chart])


def at_surface_area(cut_mesh: CutMesh, uv: FloatArray, charts: BoolArray) -> FloatArray:
    """uv with these charts centred, turned to a fixed direction, and scaled to their area on the surface.

    Turned so that the outer boundary's first vertex lies on the positive x axis from the centre.
    """
    z = uv[:, 0] + 1j * uv[:, 1]
    chart, n = cut_mesh.vertex_chart, cut_mesh.n_charts
    count = np.bincount(chart, minlength=n)
    z = z - (chart_sums(z, chart, n) / count)[chart]
    size = np.sqrt(group_max(np.abs(z) ** 2, chart, n))
    z = z / np.maximum(size, 1e-300)[chart]
    outer = outer_boundary(cut_mesh)
    towards = z[outer.vertices[outer.start]]
    far = np.abs(towards) > 1e-12
    z = z * np.where(far, np.conj(towards) / np.where(far, np.abs(towards), 1.0), 1.0)[chart]
    unit = np.stack([z.real, z.imag], 1)
    area = group_sum(np.abs(signed_areas(cut_mesh.faces, unit)), cut_mesh.chart, n)
    unit *= np.sqrt(cut_mesh.chart_areas / np.maximum(area, 1e-300))[chart][:, None]
    return np.where(charts[chart][:, None], unit, uv)
