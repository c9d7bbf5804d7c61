"""Slits from a chart's boundary to its worst vertex."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_of_runs,
    group_sum,
    next_half_edge,
)
from circparam.core.graph import nearest, undirected
from circparam.mesh.atlas import Cutting
from circparam.mesh.cut_mesh import Patches
from circparam.seams.segmentation.layout import Laid
from circparam.seams.segmentation.shorten import edge_costs
from circparam.solvers import dirichlet

SLIT_REACH = 1.6  # charts up to this share of the bound's excess over 1 are slit open, not split


def slit_charts(cutting: Cutting, laid: Laid, which: BoolArray) -> BoolArray:
    """Cut charts open along a shortest path from where they are distorted most to their border.

    Returns the charts that were cut: a chart whose worst vertex is on the border, or one with no way there,
    is not.
    """
    patches = laid.patches
    n = patches.n_vertices
    on_border = np.zeros(n, bool)
    flat = patches.faces.ravel()
    on_border[flat[patches.border]] = True
    peak = _peaks(patches, laid.uv, which & np.isfinite(laid.energy), on_border)
    done = np.zeros(len(which), bool)
    if len(peak) == 0:
        return done
    cost = edge_costs(cutting)
    inner = (
        ~cutting.cut & np.isfinite(cost) & which[patches.chart[cutting.surface.edges[:, 0] // 3]]
    )
    h = cutting.surface.edges[inner, 0]
    a, b = flat[h], flat[next_half_edge(h)]
    _, before, source = nearest(undirected(n, a, b, cost[inner]), peak)
    distance, _, _ = nearest(undirected(n, a, b, cost[inner]), peak)
    rim = np.flatnonzero(on_border & np.isfinite(distance) & (source >= 0))
    if len(rim) == 0:
        return done
    order = np.lexsort((rim, distance[rim], source[rim]))
    ends = rim[order[first_of_runs(source[rim][order])]]
    index = np.flatnonzero(inner)
    key = np.minimum(a, b) * n + np.maximum(a, b)
    by_key = np.lexsort((cost[inner], key))
    here = ends
    done[patches.vertex_chart[ends]] = True
    while len(here):
        previous = before[here]
        going = previous >= 0
        here, previous = here[going], previous[going]
        wanted = np.minimum(here, previous) * n + np.maximum(here, previous)
        cutting.cut[index[by_key[np.searchsorted(key[by_key], wanted)]]] = True
        here = previous
    return done


def _peaks(patches: Patches, uv: FloatArray, which: BoolArray, on_border: BoolArray) -> IntArray:
    """The inner vertex of each chosen chart with the largest smoothed distortion of area."""
    n = patches.n_vertices
    jacobian = dirichlet.jacobians(
        np.ascontiguousarray(patches.gradients.transpose(1, 2, 0)),
        uv[patches.faces].transpose(2, 1, 0),
    )
    value = np.abs(np.log(np.maximum(dirichlet.determinants(jacobian), 1e-30)))
    weight = patches.areas
    flat = patches.faces.ravel()
    total = np.maximum(group_sum(np.repeat(weight, 3), flat, n), 1e-300)
    field = group_sum(np.repeat(weight * value, 3), flat, n) / total
    for _ in range(4):
        face = field[patches.faces].mean(1)
        field = group_sum(np.repeat(weight * face, 3), flat, n) / total
    vertices = np.flatnonzero(which[patches.vertex_chart] & ~on_border)
    order = np.lexsort((vertices, -field[vertices], patches.vertex_chart[vertices]))
    first = first_of_runs(patches.vertex_chart[vertices][order])
    return vertices[order[first]]
