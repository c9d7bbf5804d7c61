"""Parts of a cut mesh whose faces move while the rest of the layout stays."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from circparam.core.arrays import group_sum, mask_of, numbered, positions_in
from circparam.core.graph import components
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.intrinsic import signed_areas
from circparam.mesh.cut_mesh import CutMesh, renumbered
from circparam.mesh.halfedge import corner_classes

WHOLE = 10**9  # rings: the whole chart
# a rest triangle of a region is at least so high, as a share of its longest edge
THINNEST_SHARE = 0.02
# Share of its area, every face counted positive, that a region must enclose for its boundary to count as sound.
UPRIGHT_SHARE = 0.05


def grow(cut_mesh: CutMesh, seed: BoolArray, rings: int) -> BoolArray:
    """(m,) faces within so many vertex rings of the seed faces ((m,) bool); ``WHOLE``: their whole charts."""
    if rings >= WHOLE:
        return mask_of(cut_mesh.n_charts, cut_mesh.chart[seed])[cut_mesh.chart]
    region = seed
    for _ in range(rings):
        near = mask_of(cut_mesh.n_vertices, cut_mesh.faces[region])
        a, b, c = near[cut_mesh.faces.T]
        region = a | b | c
    return region


class Region(NamedTuple):
    """Faces that move together, as a cut mesh of their own: one chart for each group of moving vertices.

    source: vertex of the whole that each vertex is. fixed: it keeps its place (such a vertex may occur in
    several groups).
    """

    cut_mesh: CutMesh
    source: IntArray
    fixed: BoolArray

    def groups(self, keep: BoolArray) -> "tuple[Region, IntArray]":
        """Some groups only, and which vertex of this region each of theirs is."""
        cut_mesh, vertices, _ = self.cut_mesh.subset(keep)
        return Region(cut_mesh, self.source[vertices], self.fixed[vertices]), vertices


def cut_out(cut_mesh: CutMesh, region: BoolArray, hold: BoolArray) -> Region:
    """The faces of a region ((m,) bool), one chart for each group of vertices that move together.

    hold: (n_vertices,) vertices that keep their places; so do those of faces outside the region.
    """
    fixed = hold.copy()
    fixed[cut_mesh.faces[~region]] = True
    a, b, c = fixed[cut_mesh.faces.T]
    region = region & ~(a & b & c)
    fid = np.flatnonzero(region)
    # (n,) label of every vertex that may move (−1 for the others); those joined by faces move together
    faces = cut_mesh.faces[fid]
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    pairs = pairs[~fixed[pairs].any(1)]
    label = np.where(fixed, -1, components(cut_mesh.n_vertices, pairs[:, 0], pairs[:, 1])[1])
    chart = label[cut_mesh.faces[fid]].max(1)  # fixed vertices have label −1
    _, chart = numbered(chart + 1)
    local = positions_in(len(cut_mesh.faces), fid)
    i, j = cut_mesh.edges[:, 0], cut_mesh.edges[:, 1]
    both = region[i // 3] & region[j // 3]
    edges = renumbered(cut_mesh.edges[both], local)
    edges = edges[chart[edges[:, 0] // 3] == chart[edges[:, 1] // 3]]
    n, faces = corner_classes(len(fid), edges)
    source = np.empty(n, np.int64)
    source[faces.ravel()] = cut_mesh.faces[fid].ravel()
    part = CutMesh(faces, cut_mesh.rest_triangles[fid], chart, edges)
    return Region(part, source, fixed[source])


def moving_region(cut_mesh: CutMesh, faces: BoolArray, hold: BoolArray, uv: FloatArray) -> Region:
    """The region of some faces ((m,) bool) of a layout uv; held vertices and those of other faces are fixed.

    The rest triangles are scaled so that a face of mean size has the area it has in the layout.
    """
    cut, source, fixed = cut_out(cut_mesh, faces, hold)
    part = replace(cut, rest_triangles=_thickened(cut))
    area = signed_areas(part.faces, uv[source])
    signed = group_sum(area, part.chart, part.n_charts)
    size = group_sum(np.abs(area), part.chart, part.n_charts)
    # the faces share the area inside the boundary, unless the boundary itself is folded
    enclosed = np.where(signed > UPRIGHT_SHARE * size, signed, size)
    scale = np.sqrt(np.maximum(enclosed, 1e-300) / part.chart_areas)
    scaled = replace(part, rest_triangles=part.rest_triangles * scale[part.chart][:, None, None])
    return Region(scaled, source, fixed)


def _thickened(cut_mesh: CutMesh) -> FloatArray:
    """Rest triangles with needles and caps raised to a least height: only their sign matters here, and their
    gradients would swamp all others."""
    length = cut_mesh.edge_lengths
    longest = length.max(1)
    out = cut_mesh.rest_triangles.copy()
    rows = np.flatnonzero(2 * cut_mesh.areas / longest < THINNEST_SHARE * longest)
    # over its longest side, the opposite corner straight above the middle
    k, base = length[rows].argmax(1), longest[rows]
    out[rows, k] = 0.0
    out[rows, (k + 1) % 3] = np.stack([base, 0 * base], 1)
    out[rows, (k + 2) % 3] = np.stack([base / 2, THINNEST_SHARE * base], 1)
    return out
