"""Parts of a cut mesh whose faces move while the rest of the layout stays."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    group_sum,
    mask_of,
    numbered,
    positions_in,
)
from circparam.core.graph import components
from circparam.core.records import dataclass
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


@dataclass(frozen=True, eq=False)
class Region:
    """Faces that move together, as a cut mesh of their own: one chart for each group of moving vertices.

    source: vertex of the whole that each vertex is. fixed: it keeps its place (such a vertex may occur in
    several groups). The rest triangles are scaled so that a face of mean size has the area it has in the
    layout.
    """

    cut_mesh: CutMesh
    source: IntArray
    fixed: BoolArray

    @property
    def faces(self) -> IntArray:
        """Faces of the region."""
        return self.cut_mesh.faces

    @property
    def chart(self) -> IntArray:
        """Group of each face."""
        return self.cut_mesh.chart

    @property
    def n_groups(self) -> int:
        """Number of groups."""
        return self.cut_mesh.n_charts

    def groups(self, keep: BoolArray) -> "tuple[Region, IntArray]":
        """Some groups only, and which vertex of this region each of theirs is."""
        cut_mesh, vertices, _ = self.cut_mesh.subset(keep)
        return Region(cut_mesh, self.source[vertices], self.fixed[vertices]), vertices


def cut_out(
    cut_mesh: CutMesh, region: BoolArray, hold: BoolArray
) -> tuple[CutMesh, IntArray, BoolArray]:
    """The faces of a region ((m,) bool) as a cut mesh, one chart for each group of vertices that move together.

    hold: (n_vertices,) vertices that keep their places; so do those of faces outside the region. Returns
    (cut mesh, (k,) vertex of the whole that each vertex is, (k,) bool: it keeps its place).
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
    return CutMesh(faces, cut_mesh.rest_triangles[fid], chart, edges), source, fixed[source]


def moving_region(cut_mesh: CutMesh, faces: BoolArray, hold: BoolArray, uv: FloatArray) -> Region:
    """The region of some faces ((m,) bool) of a layout uv; held vertices and those of other faces are fixed."""
    cut, source, fixed = cut_out(cut_mesh, faces, hold)
    part = replace(cut, rest_triangles=_thickened(cut.rest_triangles))
    area = signed_areas(part.faces, uv[source])
    signed = group_sum(area, part.chart, part.n_charts)
    size = group_sum(np.abs(area), part.chart, part.n_charts)
    # the faces share the area inside the boundary, unless the boundary itself is folded
    enclosed = np.where(signed > UPRIGHT_SHARE * size, signed, size)
    scale = np.sqrt(np.maximum(enclosed, 1e-300) / part.chart_areas)
    scaled = replace(part, rest_triangles=part.rest_triangles * scale[part.chart][:, None, None])
    return Region(scaled, source, fixed)


def _thickened(rest_triangles: FloatArray) -> FloatArray:
    """Triangles with needles and caps raised to a least height: only their sign matters here, and their
    gradients would swamp all others."""
    sides = rest_triangles[:, [1, 2, 0]] - rest_triangles
    length = np.sqrt((sides**2).sum(2))
    longest = length.max(1)
    d, e = rest_triangles[:, 1] - rest_triangles[:, 0], rest_triangles[:, 2] - rest_triangles[:, 0]
    height = 2 * ((d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]) / 2) / longest
    thin = height < THINNEST_SHARE * longest
    out = rest_triangles.copy()
    if thin.any():
        # over its longest side, the opposite corner straight above the middle
        k = length[thin].argmax(1)
        rows = np.flatnonzero(thin)
        zero = np.zeros(len(rows))
        out[rows, k] = np.stack([zero, zero], 1)
        out[rows, (k + 1) % 3] = np.stack([longest[thin], zero], 1)
        out[rows, (k + 2) % 3] = np.stack([longest[thin] / 2, THINNEST_SHARE * longest[thin]], 1)
    return out
