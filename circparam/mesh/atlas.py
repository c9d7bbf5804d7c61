"""The state of an atlas while seams are decided: which edges are cut, and the layout so far."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2, group_sum, next_half_edge
from circparam.core.graph import components
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface

CONE = 1.2  # radians of angle defect above which a vertex ends arcs


@dataclass(frozen=True, eq=False)
class Arcs:
    """Chains of cut edges between junctions: the pieces of seam that are glued or kept as a whole.

    edge: (c,) edge of the surface, arc: (c,) arc of that edge. left, right: (a,) charts on both sides, in
    ascending order. length: (a,). tip: (a,) bool, one end is free, so the arc can be zipped.
    """

    edge: IntArray
    arc: IntArray
    left: IntArray
    right: IntArray
    length: FloatArray
    tip: BoolArray


class Cutting:
    """Cut edges ``cut`` (e,) and layout ``corners`` (m, 3, 2) of one surface; both change with the seams."""

    def __init__(self, surface: Surface, cut: BoolArray, corners: FloatArray | None = None) -> None:
        self.surface = surface
        self.cut = cut.copy()
        self.corners = np.zeros((len(surface.faces), 3, 2)) if corners is None else corners.copy()

    @cached_property
    def ends(self) -> tuple[IntArray, IntArray]:
        """Both end vertices of every edge."""
        flat = self.surface.corner_vertex.ravel()
        h = self.surface.edges[:, 0]
        return flat[h], flat[next_half_edge(h)]

    @cached_property
    def n_vertices(self) -> int:
        """Number of vertices of the surface."""
        return int(self.surface.corner_vertex.max()) + 1

    @cached_property
    def on_boundary(self) -> BoolArray:
        """(vertices,) bool: the vertex is on a boundary of the surface itself."""
        flat = self.surface.corner_vertex.ravel()
        out = np.zeros(self.n_vertices, bool)
        out[flat[self.surface.boundary]] = True
        out[flat[next_half_edge(self.surface.boundary)]] = True
        return out

    @cached_property
    def boundary_lengths(self) -> FloatArray:
        """Length of every boundary half-edge of the surface."""
        h = self.surface.boundary
        f = self.surface.rest_triangles.reshape(-1, 2)
        result: FloatArray = np.linalg.norm(f[next_half_edge(h)] - f[h], axis=1)
        return result

    @cached_property
    def angle_defects(self) -> FloatArray:
        """(vertices,) curvature of every vertex: 2π minus the angles of its faces."""
        corner = self.surface.rest_triangles
        ahead = corner[:, [1, 2, 0]] - corner
        back = corner[:, [2, 0, 1]] - corner
        angle = np.arctan2(np.abs(cross2(ahead, back)), (ahead * back).sum(2))
        total = group_sum(angle.ravel(), self.surface.corner_vertex.ravel(), self.n_vertices)
        result: FloatArray = 2 * np.pi - total
        return result

    @property
    def seam_length(self) -> float:
        """Length of all seams over the square root of the area."""
        total = self.surface.edge_lengths[self.cut].sum()
        return float(total / np.sqrt(self.surface.areas.sum()))

    def charts(self) -> tuple[int, IntArray]:
        """(number of charts, (m,) chart of each face)."""
        return self.surface.charts(self.cut)

    def cut_mesh(self) -> CutMesh:
        """The surface cut open along the seams as they are now."""
        return self.surface.cut_mesh(self.cut)

    def gather(self, cut_mesh: CutMesh, fid: IntArray | None = None) -> FloatArray:
        """(nv, 2) layout of cut mesh from the corners; fid: faces of the surface that the cut mesh hold."""
        corners = self.corners if fid is None else self.corners[fid]
        uv = np.zeros((cut_mesh.n_vertices, 2))
        uv[cut_mesh.faces.ravel()] = corners.reshape(-1, 2)
        return uv

    def scatter(self, cut_mesh: CutMesh, uv: FloatArray, fid: IntArray | None = None) -> None:
        """Keep a layout of cut mesh in the corners."""
        if fid is None:
            self.corners = uv[cut_mesh.faces]
        else:
            self.corners[fid] = uv[cut_mesh.faces]

    def part(self, faces: BoolArray) -> Cutting:
        """The cutting of some faces ((m,) bool) alone."""
        inside = faces[self.surface.edges // 3].all(1)
        return Cutting(self.surface.part(faces), self.cut[inside], self.corners[faces])

    def put(self, faces: BoolArray, part: Cutting) -> None:
        """Take over what became of ``part(faces)``."""
        self.cut[faces[self.surface.edges // 3].all(1)] = part.cut
        self.corners[faces] = part.corners

    def arcs(self, chart: IntArray, cone: float = CONE) -> Arcs:
        """The arcs of the seams as they are now: chains between junctions, boundaries and cone points.

        cone: radians of curvature that make a vertex one; gluing round it can be too much.
        """
        c = np.flatnonzero(self.cut)
        a, b = self.ends[0][c], self.ends[1][c]
        valence = np.bincount(np.r_[a, b], minlength=self.n_vertices)
        through = (valence == 2) & ~self.on_boundary & (np.abs(self.angle_defects) <= cone)
        k = np.arange(len(c))
        vertex, entry = np.r_[a, b], np.r_[k, k]
        keep = through[vertex]
        vertex, entry = vertex[keep], entry[keep]
        entry = entry[np.argsort(vertex, kind="stable")]
        count, arc = components(len(c), entry[::2], entry[1::2])
        h = self.surface.edges[c]
        p, q = chart[h[:, 0] // 3], chart[h[:, 1] // 3]
        left, right = np.zeros(count, np.int64), np.zeros(count, np.int64)
        left[arc], right[arc] = np.minimum(p, q), np.maximum(p, q)
        free = (valence == 1) & ~self.on_boundary
        tip = np.zeros(count, bool)
        tip[arc[free[a] | free[b]]] = True
        length = group_sum(self.surface.edge_lengths[c], arc, count)
        return Arcs(c, arc, left, right, length, tip)
