"""Slits from a chart's boundary to its worst vertex."""

import numpy as np

from circparam.core.arrays import ends_of, first_of_groups, group_sum, mask_of
from circparam.core.graph import Graph
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.evaluate import jacobians
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.layout import ChartLayouts
from circparam.solvers import dirichlet

# over which the distortion of areas is smoothed, so that single faces are no peaks
SMOOTHING_RINGS = 2


def slit_charts(atlas: Atlas, layouts: ChartLayouts, which: BoolArray) -> BoolArray:
    """Cut charts open along a shortest path from where they are distorted most to their boundary.

    Returns the charts that were cut: a chart whose worst vertex is on the boundary, or one with no way there,
    is not.
    """
    cut_mesh = layouts.cut_mesh
    peak = _peaks(cut_mesh, layouts.uv, which & np.isfinite(layouts.energy))
    if len(peak) == 0:
        return np.zeros(cut_mesh.n_charts, bool)
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


def _peaks(cut_mesh: CutMesh, uv: FloatArray, which: BoolArray) -> IntArray:
    """The inner vertex of each chosen chart with the largest smoothed distortion of area."""
    field = smoothed_area_distortion(cut_mesh, uv)
    vertices = np.flatnonzero(which[cut_mesh.vertex_chart] & ~cut_mesh.on_boundary)
    return vertices[first_of_groups(cut_mesh.vertex_chart[vertices], -field[vertices])]


def smoothed_area_distortion(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(nv,) the logarithm of how much areas grow or shrink, without sign, smoothed over SMOOTHING_RINGS."""
    n = cut_mesh.n_vertices
    determinant = dirichlet.determinants(jacobians(cut_mesh, uv[cut_mesh.faces]))
    value = np.abs(np.log(np.maximum(determinant, 1e-30)))
    weight = cut_mesh.areas
    flat = cut_mesh.faces.ravel()
    total = np.maximum(group_sum(np.repeat(weight, 3), flat, n), 1e-300)
    field = group_sum(np.repeat(weight * value, 3), flat, n) / total
    for _ in range(SMOOTHING_RINGS):
        face = field[cut_mesh.faces].mean(1)
        field = group_sum(np.repeat(weight * face, 3), flat, n) / total
    return field
