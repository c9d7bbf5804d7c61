"""Angles, Jacobians and Laplacians of a cut mesh: all of them intrinsic, read from the rest triangles alone.

A surface bent without stretching gives the same numbers, and every function works on all charts at once.
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import cross2, cross_areas, group_sum
from circparam.core.types import FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh


def corner_products(cut_mesh: CutMesh) -> tuple[FloatArray, FloatArray]:
    """(dot, cross), each (m, 3): products of the two edge vectors that leave each corner (squared units).

    The cross product is twice the face's area at every corner. The dot product is that of the edges from corner
    k to corners k + 1 and k + 2.
    """
    p = cut_mesh.rest_triangles
    to_next = p[:, [1, 2, 0]] - p
    to_previous = -to_next[:, [2, 0, 1]]
    dot = to_next[..., 0] * to_previous[..., 0] + to_next[..., 1] * to_previous[..., 1]
    return dot, cross2(to_next, to_previous)


def corner_angles(cut_mesh: CutMesh) -> FloatArray:
    """(m, 3) angle at each corner, in radians, between 0 and π."""
    dot, cross = corner_products(cut_mesh)
    return np.arctan2(cross, dot)


def tan_half_angles(cut_mesh: CutMesh) -> FloatArray:
    """(m, 3) tan(θ/2) at each corner, accurate for needles (θ → 0) and caps (θ → π) alike.

    tan(θ/2) = |e×f| / (|e||f| + e·f) = (|e||f| − e·f) / |e×f|; each form is used where it does not cancel.
    """
    dot, cross = corner_products(cut_mesh)
    lengths = cut_mesh.edge_lengths
    product = lengths * lengths[:, [2, 0, 1]]
    acute = dot >= 0
    return np.where(acute, cross, product - dot) / np.where(acute, product + dot, cross)


def cotangents(cut_mesh: CutMesh) -> FloatArray:
    """(m, 3) cotangent of the angle at each corner."""
    dot, cross = corner_products(cut_mesh)
    return dot / cross


def vertex_angle_sums(cut_mesh: CutMesh, angles: FloatArray) -> FloatArray:
    """(n_vertices,) sum of the corner values ``angles`` (m, 3) round each vertex."""
    return group_sum(angles.ravel(), cut_mesh.faces.ravel(), cut_mesh.n_vertices)


def jacobians(
    cut_mesh: CutMesh, uv: FloatArray, faces: slice | IntArray = slice(None)
) -> FloatArray:
    """(m, 2, 2) Jacobian of the map surface → uv on each face: J[:, i, j] = ∂uv_i / ∂x_j.

    x: the plane of the rest triangle. uv: (n_vertices, 2). Built from differences, so that a translation of uv
    costs no digits. faces: numbers of the faces, None for all.
    """
    a, b, c = cut_mesh.faces[faces].T
    g = cut_mesh.gradients[faces].transpose(1, 2, 0)
    out = np.empty((2, 2, len(a)))  # in memory, for operations over whole arrays
    for i in (0, 1):
        values = uv[:, i]
        corner = values[a]
        d1, d2 = values[b] - corner, values[c] - corner
        for j in (0, 1):
            out[i, j] = d1 * g[j, 1] + d2 * g[j, 2]
    return out.transpose(2, 0, 1)


def singular_values(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(σ1, σ2), each (m,): σ1 ≥ |σ2|, and σ2 is negative where the face is flipped.

    Closed form for 2×2: E, F = (a ± d)/2, G, H = (c ± b)/2, σ = √(E² + H²) ± √(F² + G²). The smaller one is
    taken as det/σ1, which keeps its digits where both roots nearly agree.
    """
    a, b = jacobian[:, 0, 0], jacobian[:, 0, 1]
    c, d = jacobian[:, 1, 0], jacobian[:, 1, 1]
    e, f, g, h = a + d, a - d, c + b, c - b
    large = (np.sqrt(e * e + h * h) + np.sqrt(f * f + g * g)) / 2
    with np.errstate(invalid="ignore", divide="ignore"):
        small = np.where(large > 0, (a * d - b * c) / large, 0.0)
    return large, small


def signed_areas(faces: IntArray, uv: FloatArray) -> FloatArray:
    """(m,) signed area of each face in the layout, in squared uv units; positive is counter-clockwise."""
    p = uv[faces]
    return cross_areas(p) / 2


def cotangent_laplacian(cut_mesh: CutMesh) -> sps.csr_matrix:
    """(n_vertices, n_vertices) positive semidefinite Laplacian: ½ uᵀLu is the Dirichlet energy of u.

    Entry ij is −(cot α + cot β)/2, rows sum to zero; block diagonal over the charts (Pinkall, Polthier 1993).
    """
    w = cotangents(cut_mesh)[:, [2, 0, 1]].ravel() / 2  # half-edge k lies opposite corner k + 2
    i = cut_mesh.faces.ravel()
    j = cut_mesh.faces[:, [1, 2, 0]].ravel()
    n = cut_mesh.n_vertices
    matrix = sps.coo_matrix(
        (
            np.concatenate([w, w, -w, -w]),
            (np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])),
        ),
        shape=(n, n),
    )
    return matrix.tocsr()
