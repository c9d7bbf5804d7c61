"""How rough a surface is: the distortion that charts keep wherever seams run.

A vertex of a scan lies off its surface by some part of an edge, so that its neighbours cannot all keep their
lengths in the plane. For small distortions the least symmetric Dirichlet energy / 4 of a layout is 1 + mean of
u², where the Laplacian of u is the Gaussian curvature (linear elasticity without lateral contraction; a
conformal map has twice that, Ben-Chen, Gotsman, Bunin 2008). Where u changes from vertex to vertex, the linear
elements of a mesh give way more easily: layouts of squares with white noise keep half of it.
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import group_sum
from circparam.core.linalg import conjugate_gradients
from circparam.core.types import FloatArray, IntArray
from circparam.geometry.intrinsic import corner_angles, cotangent_laplacian, vertex_angle_sums
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface

SCREEN = 0.01  # of the diagonal of the Laplacian, added: waves of more than 30 edges count less
MOST = 0.5  # of u²: beyond it a length is doubled, and a spike would count for a thousand faces
CG_TOLERANCE, CG_LIMIT = 1e-2, 60  # 30 steps are the rule


def roughness_within(surface: Surface, cell: IntArray) -> FloatArray:
    """(m,) mean of u² at the corners of each face, without unit, from the curvature that varies within cells.

    cell: (vertices,) of each vertex, −1 for none. The mean curvature of a cell is that of its vertex on a
    surface that stands for this one, so charts there are distorted by it too. u is 0 on the boundary.
    """
    one = np.zeros(len(surface.faces), np.int64)
    cut_mesh = CutMesh(surface.corner_vertex, surface.rest_triangles, one, surface.edges)
    curvature = 2 * np.pi - vertex_angle_sums(cut_mesh, corner_angles(cut_mesh))
    corners = cut_mesh.faces.ravel()
    area = group_sum(np.repeat(cut_mesh.areas, 3), corners, cut_mesh.n_vertices)
    curvature[cut_mesh.on_boundary] = area[cut_mesh.on_boundary] = 0.0
    known = cell >= 0
    n = int(cell.max(initial=0)) + 1
    whole = group_sum(area[known], cell[known], n)
    mean = group_sum(curvature[known], cell[known], n) / np.where(whole > 0, whole, 1.0)
    curvature = np.where(known, curvature - mean[cell] * area, 0.0)
    # (L + SCREEN D) u = curvature, L the cotangent Laplacian, D its diagonal
    laplacian = cotangent_laplacian(cut_mesh)
    laplacian.data[~np.isfinite(laplacian.data)] = 0.0
    # half the sum of a row, without signs, is the diagonal where all weights are positive
    size = np.asarray(abs(laplacian).sum(1)).ravel() / 2
    size[size == 0] = 1.0
    screened = (laplacian + sps.diags_array(SCREEN * size)).tocsr()
    u = conjugate_gradients(screened, curvature, lambda r: r / size, CG_TOLERANCE, CG_LIMIT)
    return np.minimum(u**2, MOST)[cut_mesh.faces].mean(1)
