"""Slits from a chart's boundary to where it is bent most."""

import numpy as np

from circparam.core.arrays import ends_of, first_of_groups, group_count, mask_of
from circparam.core.graph import Graph
from circparam.core.linalg import Factor
from circparam.core.types import BoolArray, IntArray
from circparam.geometry.intrinsic import corner_angles, cotangent_laplacian, vertex_angle_sums
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.prices import edge_costs


def slit_charts(atlas: Atlas, cut_mesh: CutMesh, which: BoolArray) -> BoolArray:
    """Cut charts open along a shortest path from where they are bent most to their boundary.

    Returns the charts that were cut: one without inner vertices, or without a way to its boundary, is not.
    """
    which = which & (group_count(cut_mesh.vertex_chart[~cut_mesh.on_boundary], len(which)) > 0)
    if not which.any():
        return which
    peak = _peaks(cut_mesh, which)
    cost = edge_costs(atlas)
    inner = ~atlas.cut & np.isfinite(cost) & which[cut_mesh.chart[atlas.surface.sides[0]]]
    if atlas.flat is not None:  # they are as developable as can be: a slit there is of no use
        inner &= ~atlas.flat
    a, b = ends_of(cut_mesh.faces, atlas.surface.edges[inner, 0])
    graph = Graph(cut_mesh.n_vertices, a, b, cost[inner])
    distance, before = graph.paths(peak)
    reached = np.flatnonzero(cut_mesh.on_boundary & np.isfinite(distance))
    chart = cut_mesh.vertex_chart[reached]
    ends = reached[first_of_groups(chart, distance[reached])]
    atlas.cut[np.flatnonzero(inner)[graph.trace(before, ends)]] = True
    return mask_of(cut_mesh.n_charts, chart)


def _peaks(cut_mesh: CutMesh, which: BoolArray) -> IntArray:
    """The inner vertex of each chosen chart where a conformal flattening changes sizes most.

    The logarithm u of its scale solves L u = K with u = 0 on the boundary (Ben-Chen, Gotsman, Bunin 2008). L is
    the cotangent Laplacian, K the angle defects, whose noise on a rough surface cancels.
    """
    part, vertex, _ = cut_mesh.subset(which)
    inner = np.flatnonzero(~part.on_boundary)
    defect = 2 * np.pi - vertex_angle_sums(part, corner_angles(part))
    size = np.abs(Factor(cotangent_laplacian(part)[inner][:, inner]).solve(defect[inner]))
    return vertex[inner[first_of_groups(part.vertex_chart[inner], -size)]]
