"""Slits from a chart's boundary to its worst vertex."""

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    edge_keys,
    ends_of,
    first_of_groups,
    group_sum,
)
from circparam.core.graph import nearest, undirected
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
    n = cut_mesh.n_vertices
    peak = _peaks(cut_mesh, layouts.uv, which & np.isfinite(layouts.energy))
    done = np.zeros(cut_mesh.n_charts, bool)
    if len(peak) == 0:
        return done
    cost = edge_costs(atlas)
    inner = ~atlas.cut & np.isfinite(cost) & which[cut_mesh.chart[atlas.surface.sides[0]]]
    if atlas.flat is not None:  # they are as developable as can be: a slit there is of no use
        inner &= ~atlas.flat
    a, b = ends_of(cut_mesh.faces, atlas.surface.edges[inner, 0])
    distance, before, source = nearest(undirected(n, a, b, cost[inner]), peak)
    reached = np.flatnonzero(cut_mesh.on_boundary & np.isfinite(distance) & (source >= 0))
    if len(reached) == 0:
        return done
    here = reached[first_of_groups(source[reached], distance[reached])]
    done[cut_mesh.vertex_chart[here]] = True
    index = np.flatnonzero(inner)
    key = edge_keys(a, b, n)
    by_key = np.lexsort((cost[inner], key))
    while len(here := here[before[here] >= 0]):
        edge = edge_keys(here, before[here], n)
        atlas.cut[index[by_key[np.searchsorted(key[by_key], edge)]]] = True
        here = before[here]
    return done


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
