"""The surface cut open: its charts, boundary loops and Euler characteristics."""

from functools import cached_property

import numpy as np

from circparam.core.arrays import (
    doubled_areas,
    ends_of,
    first_of_groups,
    group_count,
    group_max,
    group_sum,
    mask_of,
    next_half_edge,
    norms3,
    positions_in,
    ranges,
    slices,
    sorted_distinct,
)
from circparam.core.graph import cycles
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.halfedge import boundary_half_edges, corner_classes

# cached properties of a cut mesh that do not depend on lengths
TOPOLOGICAL_PROPERTIES = (
    "n_vertices",
    "n_charts",
    "vertex_chart",
    "boundary",
    "_elimination",
    "_pattern",
    "rim",
)
# cached properties that follow from the arrays alone, whatever was solved
SHAPE_PROPERTIES = (
    *("n_vertices", "n_charts", "areas", "gradients", "edge_lengths", "chart_areas"),
    *("vertex_chart", "boundary", "loops"),
)


@dataclass(frozen=True, eq=False)
class Loops:
    """Boundary loops of a cut mesh, in order along the boundary (surface on the left).

    half_edges: (b,) int64, the boundary half-edges, loop after loop. start: (L + 1,) int64 offsets.
    chart: (L,) int64. length: (L,) float64, in the units of the mesh. outer: (L,) bool, the longest loop of
    its chart (the first where several are equally long).
    """

    half_edges: IntArray
    start: IntArray
    chart: IntArray
    length: FloatArray
    outer: BoolArray

    @property
    def loop_of(self) -> IntArray:
        """(b,) int64: loop of each entry of half_edges."""
        return np.repeat(np.arange(len(self.chart)), np.diff(self.start))


@dataclass(frozen=True, eq=False)
class Roughness:
    """Distortion that charts have on the mesh besides what they have here, on a smaller and smoother surface.

    values: (m,) of each face, symmetric Dirichlet energy / 4. most: no chart counts more than that, since the
    bound could not be kept wherever seams run.
    """

    values: FloatArray
    most: float

    def part(self, faces: BoolArray | IntArray) -> "Roughness":
        """Of some faces."""
        return Roughness(self.values[faces], self.most)

    def of_charts(self, areas: FloatArray, chart: IntArray, n: int) -> FloatArray:
        """(n,) mean over the area of each chart, or ``most``."""
        mean = group_sum(areas * self.values, chart, n) / group_sum(areas, chart, n)
        return np.minimum(mean, self.most)


@dataclass(frozen=True, eq=False)
class CutMesh:
    """The input of a method: charts cut open, every triangle laid isometrically in the plane.

    faces: (m, 3) int64 into the vertices of the cut mesh, counter-clockwise. rest_triangles: (m, 3, 2) float64,
    plane coordinates of the corners of each face, in the units of the mesh, positive area.
    chart: (m,) int64, 0..n_charts−1. edges: (e, 2) int64, the two half-edges of every inner edge.
    Half-edge 3f + k runs from corner k to corner k + 1 of face f. roughness: of a surface that stands for
    another one.
    """

    faces: IntArray
    rest_triangles: FloatArray
    chart: IntArray
    edges: IntArray
    roughness: Roughness | None = None

    @cached_property
    def chart_roughness(self) -> FloatArray:
        """(n_charts,) what the energy of each chart counts besides its own, mostly nothing."""
        if self.roughness is None:
            return np.zeros(self.n_charts)
        return self.roughness.of_charts(self.areas, self.chart, self.n_charts)

    @cached_property
    def n_vertices(self) -> int:
        """Number of vertices of the cut mesh."""
        return int(self.faces.max(initial=-1)) + 1

    @cached_property
    def n_charts(self) -> int:
        """Number of charts."""
        return int(self.chart.max(initial=-1)) + 1

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) area of each face, in squared units of the mesh."""
        (ax, bx, cx), (ay, by, cy) = self.rest_triangles.T
        return ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2

    @cached_property
    def gradients(self) -> FloatArray:
        """(m, 2, 3): column k is the gradient of the hat function of corner k. J = (gradients @ u).T for corner
        values u (3, 2)."""
        x, y = self.rest_triangles.T
        before, after = [2, 0, 1], [1, 2, 0]
        # in memory (2, 3, m), for operations over whole arrays
        g = np.stack([y[after] - y[before], x[before] - x[after]])
        g /= 2 * self.areas
        return g.transpose(2, 0, 1)

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """(m, 3): length of half-edge 3f + k."""
        x, y = self.rest_triangles.T
        dx, dy = x[[1, 2, 0]] - x, y[[1, 2, 0]] - y
        return np.sqrt(dx * dx + dy * dy).T

    def lengths(self, half_edges: IntArray) -> FloatArray:
        """(h,) length of each of the given half-edges."""
        corners = self.rest_triangles.reshape(-1, 2)
        x, y = (corners[next_half_edge(half_edges)] - corners[half_edges]).T
        return np.sqrt(x * x + y * y)

    @cached_property
    def chart_areas(self) -> FloatArray:
        """(n_charts,) area of each chart."""
        return group_sum(self.areas, self.chart, self.n_charts)

    @cached_property
    def vertex_chart(self) -> IntArray:
        """(n_vertices,) chart of each vertex."""
        out = np.zeros(self.n_vertices, np.int64)
        out[self.faces.ravel()] = np.repeat(self.chart, 3)
        return out

    @cached_property
    def boundary(self) -> IntArray:
        """(b,) half-edges on a boundary, in ascending order."""
        return boundary_half_edges(len(self.faces), self.edges)

    @property
    def on_boundary(self) -> BoolArray:
        """(n_vertices,) bool: vertices on a boundary; each of them begins one of its half-edges."""
        return mask_of(self.n_vertices, self.faces.ravel()[self.boundary])

    @cached_property
    def rim(self) -> tuple[IntArray, IntArray]:
        """((b,), (b,)) places in ``boundary`` of the next and of the previous half-edge along the boundary."""
        h, label = self.boundary, self.faces.ravel()
        # a vertex of several fans: follow each fan for itself
        if len(sorted_distinct(label[h])) < len(h):
            label = corner_classes(len(self.faces), self.edges)[1].ravel()
        following = positions_in(int(label.max(initial=-1)) + 1, label[h])[label[next_half_edge(h)]]
        return following, positions_in(len(h), following)

    @cached_property
    def loops(self) -> Loops:
        """The boundary loops, ordered."""
        h = self.boundary
        labels, order, size = cycles(self.rim[0])
        start = np.concatenate([[0], np.cumsum(size)])
        chart = self.chart[h[order][start[:-1]] // 3]
        length = group_sum(self.lengths(h), labels, len(size))
        outer = mask_of(len(size), first_of_groups(chart, -length))
        return Loops(h[order], start, chart, length, outer)

    def twin(self) -> "CutMesh":
        """The same cut mesh with its shapes, without what solves have left on it."""
        out = CutMesh(self.faces, self.rest_triangles, self.chart, self.edges, self.roughness)
        out.__dict__.update(
            {name: self.__dict__[name] for name in SHAPE_PROPERTIES if name in self.__dict__}
        )
        return out

    @property
    def elimination(self) -> IntArray | None:
        """(n_vertices,) an order of the vertices in which factorisations fill little, where one is known."""
        return self.__dict__.get("_elimination")

    def eliminated_in(self, order: IntArray) -> None:
        """Keep an order of elimination; it goes along to parts of the cut mesh. Results change by rounding."""
        self.__dict__["_elimination"] = order

    def in_units_of(self, unit: float) -> "CutMesh":
        """The same charts with lengths in that unit and with the cached topology; the result of the last call
        is kept."""
        kept: tuple[float, CutMesh] | None = self.__dict__.get("_in_units")
        if kept is not None and kept[0] == unit:
            out = kept[1]
        else:
            out = CutMesh(
                self.faces, self.rest_triangles / unit, self.chart, self.edges, self.roughness
            )
            self.__dict__["_in_units"] = unit, out
        for name in TOPOLOGICAL_PROPERTIES:
            if name in self.__dict__:
                out.__dict__[name] = self.__dict__[name]
            else:  # a cache of an earlier solve would change the last bits of the result
                out.__dict__.pop(name, None)
        return out

    def euler(self) -> IntArray:
        """(n_charts,) Euler characteristic: a disk has 1, a disk with h holes 1 − h, a sphere 2."""
        n = self.n_charts
        faces, vertices = group_count(self.chart, n), group_count(self.vertex_chart, n)
        inner = group_count(self.chart[self.edges[:, 0] // 3], n)
        return vertices - (3 * faces - inner) + faces

    def subset(self, charts: BoolArray) -> "tuple[CutMesh, IntArray, IntArray]":
        """The cut mesh of some charts; returns (cut mesh, vertices, faces): the earlier number of each."""
        if charts.all():
            return self, np.arange(self.n_vertices), np.arange(len(self.faces))
        fid = np.flatnonzero(charts[self.chart])
        vid = np.flatnonzero(charts[self.vertex_chart])
        new_vertex = positions_in(self.n_vertices, vid)
        new_face = positions_in(len(self.faces), fid)
        edges = self.edges[charts[self.chart[self.edges[:, 0] // 3]]]
        new_chart = np.cumsum(charts) - 1
        part = CutMesh(
            new_vertex[self.faces[fid]],
            self.rest_triangles[fid],
            new_chart[self.chart[fid]],
            renumbered(edges, new_face),
            None if self.roughness is None else self.roughness.part(fid),
        )
        if self.elimination is not None:
            order = new_vertex[self.elimination]
            part.eliminated_in(order[order >= 0])
        return part, vid, fid


def renumbered(edges: IntArray, new_face: IntArray) -> IntArray:
    """Half-edges (e, 2) after a change of the numbers of the faces: new_face (m,)."""
    face = edges // 3
    return edges + 3 * (new_face[face] - face)


def rest_triangles_of(corners: FloatArray) -> FloatArray:
    """Lay triangles isometrically in the plane: corners (m, 3, 3) → (m, 3, 2).

    Corner 0 goes to the origin, corner 1 to the positive x axis, corner 2 above it.
    """
    return laid_flat(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def laid_flat(points: FloatArray, faces: IntArray) -> FloatArray:
    """As ``rest_triangles_of``, of triangles (m, 3) of points (n, 3)."""
    out = np.zeros((len(faces), 3, 2))
    for k in slices(len(faces)):
        a, b, c = points[faces[k, 0]], points[faces[k, 1]], points[faces[k, 2]]
        e1, e2 = b - a, c - a
        x = norms3(e1)
        out[k, 1, 0] = x
        with np.errstate(invalid="ignore", divide="ignore"):
            out[k, 2, 0] = np.einsum("ij,ij->i", e1, e2) / x
            out[k, 2, 1] = doubled_areas(e1, e2) / x
    return out


def close_holes(cut_mesh: CutMesh) -> CutMesh:
    """Close every inner hole with a fan of virtual faces round one virtual vertex, for the solve only.

    The virtual triangles are isosceles, with the legs of a cone that would lie flat round the hole (perimeter /
    2π). The closing is therefore intrinsic. The virtual faces and vertices stand behind the real ones.
    """
    loops = cut_mesh.loops
    entries = np.flatnonzero(~loops.outer[loops.loop_of])
    if len(entries) == 0:
        return cut_mesh
    h, loop = loops.half_edges[entries], loops.loop_of[entries]
    start, end = ends_of(cut_mesh.faces, h)
    centre = cut_mesh.n_vertices + (np.cumsum(~loops.outer) - 1)[loop]
    base = cut_mesh.edge_lengths.ravel()[h]
    longest = group_max(base, loop, len(loops.chart))
    leg = np.maximum(loops.length / (2 * np.pi), 0.6 * longest)[loop]
    # virtual face: corner 0 = end of the boundary half-edge, 1 = its start, 2 = the virtual vertex
    new_faces = np.stack([end, start, centre], 1)
    rest_triangles = np.zeros((len(h), 3, 2))
    rest_triangles[:, 1, 0], rest_triangles[:, 2, 0] = base, base / 2
    rest_triangles[:, 2, 1] = np.sqrt(leg**2 - (base / 2) ** 2)
    f, size = len(cut_mesh.faces) + np.arange(len(h)), np.diff(loops.start)
    # entries of one loop are contiguous, so the follower is the next entry, cyclically
    local = ranges(size[~loops.outer])
    follower = np.arange(len(h)) - local + (local + 1) % size[loop]
    edges = np.concatenate(
        [
            cut_mesh.edges,
            np.stack([h, 3 * f], 1),
            # side 2→0 ends at the end of h; side 1→2 of the follower starts there
            np.stack([3 * f + 2, 3 * f[follower] + 1], 1),
        ]
    )
    return CutMesh(
        np.concatenate([cut_mesh.faces, new_faces]),
        np.concatenate([cut_mesh.rest_triangles, rest_triangles]),
        np.concatenate([cut_mesh.chart, loops.chart[loop]]),
        edges,
    )


def not_disks(cut_mesh: CutMesh) -> BoolArray:
    """(n_charts,) bool: the chart is neither a disk nor a disk with holes."""
    loops = group_count(cut_mesh.loops.chart, cut_mesh.n_charts)
    return (loops < 1) | (cut_mesh.euler() != 2 - loops)
