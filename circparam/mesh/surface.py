"""Half-edges, the surface that seams are cut into, and the report on its topology."""

from dataclasses import field, replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import (
    mask_of,
    next_half_edge,
    normals_of,
    norms3,
    numbered,
    positions_in,
    slices,
)
from circparam.core.graph import components
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh, Roughness, laid_flat, renumbered
from circparam.mesh.halfedge import boundary_half_edges, corner_classes, sides_apart


@dataclass(frozen=True, eq=False)
class Surface:
    """The oriented manifold that seams and methods work on: made from a mesh by maps, not by edits.

    points: (n, 3) float64, the points of the mesh, centred and scaled only where that is said.
    faces: (m, 3) int64 into points through the weld map, wound consistently for the solve.
    source: (m,) int64, the face of the mesh each face comes from (degenerate and duplicate faces are set
    aside and missing here). reversed_faces: (m,) bool, the winding is the reverse of the file's.
    edges: (e, 2) int64, pairs of half-edges that belong together and run against each other, i < j, in
    ascending order of i. A half-edge in no pair is on a boundary: a non-manifold edge keeps pairs of faces,
    every face at most once. Half-edge 3f + k runs from corner k to corner k + 1.
    locked: (e,) bool, edges that no seam may follow (inside a polygon, or forbidden by the user).
    price: (e,) cost of a seam along an edge, in lengths of the edge; None if all edges are equal.
    weighted: the prices hold weights of the user: they count wherever seams are chosen, not only moved.
    first: (m,) int64, the corner of the file's face that corner 0 is; None if it is that face's own first.
    torn: (t, 2) int64, pairs of half-edges that repair let go because the component has one side only. Both run
    the same way along their edge; the cut between them is a seam like any other, though no pair.
    density: (m,) positive, how dense the texels of each face are to be beside others; None if all are alike.
    dense: shapes and areas are those at the density, as layouts are compared with them.
    whole_area: of the surface that this one is a part of; None if it is whole.
    roughness: of the surface for which this one stands; None if it stands for none.
    """

    points: FloatArray
    faces: IntArray
    source: IntArray
    reversed_faces: BoolArray
    edges: IntArray
    locked: BoolArray
    torn: IntArray = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    price: FloatArray | None = None
    first: IntArray | None = None
    weighted: bool = False
    density: FloatArray | None = None
    dense: bool = False
    whole_area: float | None = None
    roughness: Roughness | None = None

    @property
    def corners(self) -> FloatArray:
        """(m, 3, 3) position of the corners of each face."""
        return self.points[self.faces]

    @cached_property
    def file_corners(self) -> IntArray:
        """(m, 3) int64: the corner of the file's face that each corner is."""
        step = np.where(self.reversed_faces, -1, 1)[:, None] * np.arange(3)
        return (step if self.first is None else step + self.first[:, None]) % 3

    def from_file(self, values: IntArray) -> IntArray:
        """(m, 3) values of the corners, from those of the corners of the file's faces (f, 3)."""
        return values[self.source[:, None], self.file_corners]

    def to_file(self, values: IntArray) -> IntArray:
        """(m, 3) values of the corners in the order of the file's faces ``source``, from (m, 3) of these."""
        out = np.empty_like(values)
        np.put_along_axis(out, self.file_corners, values, 1)
        return out

    @cached_property
    def sides(self) -> IntArray:
        """(2, e) int64: the two faces of each edge, the rows contiguous."""
        return np.ascontiguousarray(self.edges.T) // 3

    def inner_edges(self, faces: BoolArray) -> BoolArray:
        """(e,) bool: both faces of the edge are among ``faces`` ((m,) bool)."""
        left, right = self.sides
        return faces[left] & faces[right]

    @cached_property
    def corner_vertex(self) -> IntArray:
        """(m, 3) int64: vertex of each corner; a non-manifold vertex is one vertex for each of its fans."""
        return corner_classes(len(self.faces), self.edges)[1]

    @cached_property
    def vertex_points(self) -> FloatArray:
        """(vertices, 3): position of every vertex of corner_vertex."""
        out = np.zeros((int(self.corner_vertex.max()) + 1, 3))
        out[self.corner_vertex.ravel()] = self.points[self.faces.ravel()]
        return out

    @cached_property
    def rest_triangles(self) -> FloatArray:
        """(m, 3, 2): every face laid isometrically in the plane; of a dense surface times its density."""
        flat = laid_flat(self.points, self.faces)
        if not self.dense or self.density is None:
            return flat
        return flat * self.density[:, None, None]

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) area of each face."""
        return self.rest_triangles[:, 1, 0] * self.rest_triangles[:, 2, 1] / 2

    @property
    def unit(self) -> float:
        """√ of the area of the whole surface: the length in which the cost of an atlas is measured."""
        return float(np.sqrt(self.areas.sum() if self.whole_area is None else self.whole_area))

    @property
    def true_areas(self) -> FloatArray:
        """(m,) area of each face in space, whatever its density."""
        if not self.dense or self.density is None:
            return self.areas
        return self.areas / self.density**2

    def at_density(self) -> "Surface":
        """The surface with faces as large as their density asks, which layouts are compared with.

        Seams are found on the plain one: they run between densities and depend on them no further.
        """
        return self if self.density is None or self.dense else replace(self, dense=True)

    @cached_property
    def normals(self) -> FloatArray:
        """(m, 3) unit normals."""
        out = np.empty((len(self.faces), 3))
        for k in slices(len(out)):
            n = normals_of(self.points[self.faces[k]])
            out[k] = n / np.maximum(norms3(n), 1e-300)[:, None]
        return out

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """(e,) length of each edge in ``edges``."""
        return self.lengths(self.edges[:, 0])

    @property
    def weighted_lengths(self) -> FloatArray:
        """(e,) length of each edge, times the weight that the user gives it, if any."""
        if self.price is None or not self.weighted:
            return self.edge_lengths
        return self.edge_lengths * self.price

    def forget(self) -> None:
        """Drop cached shapes of the faces; they are computed again when needed."""
        for name in (
            "rest_triangles",
            "areas",
            "normals",
            "edge_lengths",
            "priced_lengths",
            "_opened",
        ):
            self.__dict__.pop(name, None)

    def torn_seams(self, corners: FloatArray) -> IntArray:
        """(s,) half-edges of ``torn`` whose two sides have different uv; corners (m, 3, 2)."""
        return self.torn[sides_apart(corners, self.torn, same_way=True), 0]

    def lengths(self, half_edges: IntArray) -> FloatArray:
        """(h,) length of each of the given half-edges."""
        flat, out = self.faces.ravel(), np.empty(len(half_edges))
        for k in slices(len(out)):
            h = half_edges[k]
            out[k] = norms3(self.points[flat[next_half_edge(h)]] - self.points[flat[h]])
        return out

    @cached_property
    def priced_lengths(self) -> FloatArray:
        """(e,) cost of a seam along each edge: its length times its price, if any."""
        return self.edge_lengths if self.price is None else self.edge_lengths * self.price

    @cached_property
    def boundary(self) -> IntArray:
        """Half-edges on a boundary of the surface itself, ascending."""
        return boundary_half_edges(len(self.faces), self.edges)

    @cached_property
    def boundary_lengths(self) -> FloatArray:
        """Length of every half-edge of ``boundary``."""
        h, corner = self.boundary, self.rest_triangles.reshape(-1, 2)
        return np.linalg.norm(corner[next_half_edge(h)] - corner[h], axis=1)

    @cached_property
    def components(self) -> tuple[int, IntArray]:
        """Number of components, and (m,) int64 the component of each face."""
        return self.charts(np.zeros(len(self.edges), bool))

    def whole_components(self, faces: BoolArray) -> BoolArray:
        """(m,) bool: every face of the components that hold some of ``faces`` ((m,) bool)."""
        _, component = self.components
        return np.isin(component, component[faces])

    def components_with(self, edges: BoolArray) -> BoolArray:
        """(m,) bool: every face of the components that hold some of the ``edges`` ((e,) bool)."""
        return self.whole_components(mask_of(len(self.faces), self.sides[0, edges]))

    def charts(self, cut: BoolArray) -> tuple[int, IntArray]:
        """Components of the faces across the edges that are not cut: (number, (m,) label)."""
        # used many times between two changes of the seams
        kept: tuple[BoolArray, int, IntArray] | None = self.__dict__.get("_charts")
        if kept is None or not np.array_equal(kept[0], cut):
            left, right = self.sides[:, ~cut]
            kept = cut.copy(), *components(len(self.faces), left, right)
            kept[2].setflags(write=False)
            self.__dict__["_charts"] = kept
        return kept[1:]

    def cut_mesh(self, cut: BoolArray) -> CutMesh:
        """The whole surface cut open along ``cut`` ((e,) bool): charts and faces in order.

        One along the same seams as the last shares its arrays and its shapes, but nothing that a solve left.
        """
        kept: tuple[BoolArray, CutMesh] | None = self.__dict__.get("_opened")
        if kept is not None and np.array_equal(kept[0], cut):
            last = kept[1].twin()
        else:
            _, chart = self.charts(cut)
            edges = self.edges[~cut]
            _, corners = corner_classes(len(self.faces), edges)
            last = CutMesh(corners, self.rest_triangles, chart, edges, self.roughness)
        self.__dict__["_opened"] = cut.copy(), last
        return last

    def __getstate__(self) -> dict[str, object]:
        """Another process derives large arrays itself: the cut mesh is larger than the surface."""
        large = ("_opened", "sides")
        return {name: value for name, value in self.__dict__.items() if name not in large}

    def part_cut_mesh(
        self, cut: BoolArray, faces: BoolArray, chart: IntArray
    ) -> tuple[CutMesh, IntArray]:
        """The cut mesh of some faces only. chart: (m,) labels; those of these faces are numbered anew.

        Returns (cut mesh, (k,) face of the surface that each of its faces is).
        """
        fid = np.flatnonzero(faces)
        local = positions_in(len(self.faces), fid)
        e = renumbered(self.edges[~cut & self.inner_edges(faces)], local)
        _, corners = corner_classes(len(fid), e)
        rough = None if self.roughness is None else self.roughness.part(fid)
        return CutMesh(corners, self.rest_triangles[fid], numbered(chart[fid])[1], e, rough), fid

    def without_edges(self, cut: BoolArray) -> "Surface":
        """The surface opened along some edges ((e,) bool), which become boundaries; of none: itself."""
        if not cut.any():
            return self
        keep = ~cut
        price = None if self.price is None else self.price[keep]
        return replace(self, edges=self.edges[keep], locked=self.locked[keep], price=price)

    def unpriced(self) -> "Surface":
        """The surface without prices, but for those of the user."""
        return self if self.price is None or self.weighted else replace(self, price=None)

    def compact(self) -> "Surface":
        """The same with used points alone, in their order, for another process."""
        used = mask_of(len(self.points), self.faces)
        number = np.cumsum(used) - 1
        return replace(self, points=self.points[used], faces=number[self.faces])

    def part(self, faces: BoolArray) -> "Surface":
        """Some faces ((m,) bool); where they meet the others is a boundary. Of all: itself."""
        if faces.all() and not len(self.torn):
            return self
        fid, inside = np.flatnonzero(faces), self.inner_edges(faces)
        return replace(
            self,
            faces=self.faces[fid],
            source=self.source[fid],
            reversed_faces=self.reversed_faces[fid],
            edges=renumbered(self.edges[inside], positions_in(len(self.faces), fid)),
            locked=self.locked[inside],
            torn=self.torn[:0],
            price=None if self.price is None else self.price[inside],
            first=None if self.first is None else self.first[fid],
            density=None if self.density is None else self.density[fid],
            whole_area=float(self.areas.sum()) if self.whole_area is None else self.whole_area,
            roughness=None if self.roughness is None else self.roughness.part(fid),
        )
