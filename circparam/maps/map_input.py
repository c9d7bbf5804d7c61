"""A mesh as one side of a map: its checks, and the closed mesh that replaces it."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import first_of_each, group_count, interpolated, next_half_edge
from circparam.core.graph import components
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import InputError, TopologyError
from circparam.maps.surface_map import Places
from circparam.mesh.cut_mesh import CutMesh, rest_triangles_of
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.surface import Surface


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """points (n, 3); faces (m, 3), closed, wound counter-clockwise seen from outside.

    parent (m,): the face of the surface that each face is a part of, −1 if it closes a boundary. corners (m,
    3, 3): barycentric coordinates of its corners in that face. The vertices of the surface come first, then the
    tips of the cones over its boundaries, then the vertices that split edges. origin (m,): the face of the mesh
    before its edges were split.
    """

    points: FloatArray
    faces: IntArray
    parent: IntArray
    corners: FloatArray
    origin: IntArray

    @property
    def n(self) -> int:
        """Number of vertices."""
        return len(self.points)

    @cached_property
    def _sorted(self) -> tuple[IntArray, IntArray]:
        """Half-edges by the key start · n + end: (keys ascending, half-edges)."""
        key = self.faces.ravel() * self.n + self.faces[:, [1, 2, 0]].ravel()
        order = np.argsort(key, kind="stable")
        return key[order], order

    def half_edges(self, start: IntArray, end: IntArray) -> IntArray:
        """(k,) the half-edge from each start to each end; −1 if there is none."""
        keys, order = self._sorted
        asked = np.asarray(start) * self.n + np.asarray(end)
        at = np.minimum(np.searchsorted(keys, asked), len(keys) - 1)
        return np.where(keys[at] == asked, order[at], -1)

    @cached_property
    def twin(self) -> IntArray:
        """(3m,) the half-edge on the other side of each."""
        return self.half_edges(self.faces[:, [1, 2, 0]].ravel(), self.faces.ravel())

    @cached_property
    def first_out(self) -> IntArray:
        """(n,) one half-edge that leaves each vertex."""
        return first_of_each(self.faces.ravel(), self.n)

    @property
    def simple(self) -> bool:
        """Whether it is closed and no two edges join the same two vertices."""
        keys = self._sorted[0]
        return bool((self.twin >= 0).all() and (keys[1:] != keys[:-1]).all())

    def on_surface(self, places: Places) -> Places:
        """Places on this mesh as places on the surface that it closes."""
        weights = np.maximum(interpolated(places.weights, self.corners[places.face]), 0)
        return Places(self.parent[places.face], weights / weights.sum(1, keepdims=True))

    def ring(self, vertex: int) -> list[int]:
        """The neighbours of a vertex, counter-clockwise."""
        flat, twin = self.faces.ravel(), self.twin
        first = h = int(self.first_out[vertex])
        out = []
        while True:
            out.append(int(flat[h - 2 if h % 3 == 2 else h + 1]))
            h = int(twin[h + 2 if h % 3 == 0 else h - 1])
            if h == first:
                return out

    @cached_property
    def cut_mesh(self) -> CutMesh:
        """As methods see it: one chart without a boundary."""
        h = np.arange(3 * len(self.faces))
        lower = h < self.twin
        return CutMesh(
            self.faces,
            rest_triangles_of(self.points[self.faces]),
            np.zeros(len(self.faces), np.int64),
            np.stack([h[lower], self.twin[lower]], 1),
        )

    def pieces(self, cut: BoolArray, on: BoolArray) -> tuple[IntArray, IntArray]:
        """(piece (m,) of each face between cut half-edges (3m,), Euler characteristic of the inside of each);
        on: (n,) bool, vertices on the cuts."""
        h = np.flatnonzero(~cut)
        count, label = components(len(self.faces), h // 3, self.twin[h] // 3)
        edges = group_count(label[h // 3], count) // 2
        vertices = group_count(label[self.first_out[~on] // 3], count)
        return label, group_count(label, count) - edges + vertices

    def shares(self, path: IntArray) -> FloatArray:
        """(p,) position of the vertices along a path, from 0 to 1, by length."""
        steps = np.linalg.norm(np.diff(self.points[path], axis=0), axis=1)
        run = np.r_[0.0, np.cumsum(np.maximum(steps, 1e-9 * steps.max()))]
        return run / run[-1]

    def divided(self, path: IntArray, parts: int) -> IntArray:
        """The entries of a path that divide it into so many parts by length, none at its ends.

        Raises TopologyError if it has no more vertices than parts.
        """
        if len(path) <= parts:
            raise TopologyError(
                f"a seam or boundary of {counted(len(path) - 1, 'edge')} between two landmarks or nodes is too "
                "short to be divided: subdivide the mesh, or move a landmark"
            )
        share = self.shares(path)
        out: list[int] = []
        for k in range(1, parts):
            pick = int(np.abs(share - k / parts).argmin())
            out.append(min(max(pick, out[-1] + 1 if out else 1), len(path) - 1 - (parts - k)))
        return np.array(out, np.int64)

    def split(
        self, half_edges: IntArray, share: FloatArray | None = None
    ) -> "tuple[ClosedMesh, IntArray]":
        """Edges split into two each: (the mesh, (k,) the vertex that splits each).

        half_edges (k,): one of every edge. share (k,): the place along each edge, half if None.
        """
        mesh, left = self, np.arange(len(half_edges))
        share = np.full(len(left), 0.5) if share is None else share
        start, end = self.faces.ravel()[half_edges], self.faces.ravel()[next_half_edge(half_edges)]
        middle = np.full(len(left), -1)
        while len(left):
            h = mesh.half_edges(start[left], end[left])
            lower = np.minimum(h, mesh.twin[h])
            first = np.full(len(mesh.faces), len(mesh.twin))
            sides = lower // 3, mesh.twin[lower] // 3
            for side in sides:
                np.minimum.at(first, side, lower)
            now = np.flatnonzero((first[sides[0]] == lower) & (first[sides[1]] == lower))
            now = now[np.argsort(lower[now])]  # one edge of a face at most
            along = np.where(h == lower, share[left], 1 - share[left])
            middle[left[now]] = mesh.n + np.arange(len(now))
            mesh = mesh._split_apart(lower[now], along[now])
            left = np.delete(left, now)
        return mesh, middle

    def _split_apart(self, half_edges: IntArray, share: FloatArray) -> "ClosedMesh":
        """Split edges of which no face has two: a b c becomes a m c, in its place, and m b c, at the end."""
        h = np.concatenate([half_edges, self.twin[half_edges]])
        order = np.argsort(h)
        h, t = h[order], np.concatenate([share, 1 - share])[order][:, None]
        middle = self.n + order % len(share)
        f, k, following = h // 3, h % 3, (h % 3 + 1) % 3
        rows = np.arange(len(h))
        between = (1 - t) * self.corners[f, k] + t * self.corners[f, following]
        faces, corners = self.faces.copy(), self.corners.copy()
        new_faces, new_corners = self.faces[f].copy(), self.corners[f].copy()
        faces[f, following] = new_faces[rows, k] = middle
        corners[f, following] = new_corners[rows, k] = between
        flat, s = self.faces.ravel(), share[:, None]
        a, b = (self.points[flat[x]] for x in (half_edges, next_half_edge(half_edges)))
        return ClosedMesh(
            np.concatenate([self.points, (1 - s) * a + s * b]),
            np.concatenate([faces, new_faces]),
            np.concatenate([self.parent, self.parent[f]]),
            np.concatenate([corners, new_corners]),
            np.concatenate([self.origin, self.origin[f]]),
        )


@dataclass(frozen=True, eq=False)
class MapInput:
    """A connected surface, with or without boundaries.

    name: of the file, or A or B, for messages. surface: in the winding of the solve. closed: the surface with
    closed boundaries, the vertices of the surface first, then one that closes each boundary. loops: the
    vertices of each boundary, in order with the surface on the left. vertex (n,): of each vertex of
    the mesh, −1 if no face uses it. notes: repairs.
    """

    name: str
    mesh: Mesh
    surface: Surface
    closed: ClosedMesh
    loops: list[IntArray]
    vertex: IntArray
    notes: list[str]
    genus: int

    @property
    def n(self) -> int:
        """Number of vertices of the surface."""
        return len(self.surface.vertex_points)

    @cached_property
    def size(self) -> float:
        """Diagonal of the box round it, in units of the solve."""
        return float(np.linalg.norm(np.ptp(self.surface.vertex_points, axis=0)))

    @cached_property
    def area(self) -> float:
        """Area of the surface, in units of the solve."""
        return float(self.surface.areas.sum())

    @cached_property
    def on_boundary(self) -> IntArray:
        """(n,) which boundary a vertex of the surface is on, −1 if none."""
        out = np.full(self.n, -1)
        for k, loop in enumerate(self.loops):
            out[loop] = k
        return out

    def along_boundary(self, start: int, end: int) -> IntArray:
        """The vertices of a boundary from one to another (or round), with the surface on the left."""
        loop = self.loops[int(self.on_boundary[start])]
        first, last = (int(np.flatnonzero(loop == v)[0]) for v in (start, end))
        count = (last - first) % len(loop) or len(loop)
        return loop[(first + np.arange(count + 1)) % len(loop)]

    def from_corners(self, corners: list[int]) -> tuple[IntArray, FloatArray]:
        """(the boundary of some vertices, in order, from the first on; the position of each of its vertices:
        the number of corners passed, and the share to the next by length)."""
        loop = self.along_boundary(corners[0], corners[0])
        run = self.closed.shares(loop)
        at = np.array([int(np.flatnonzero(loop[:-1] == c)[0]) for c in corners] + [len(loop) - 1])
        place = np.interp(run, run[at], np.arange(len(at), dtype=np.float64))
        return loop[:-1], np.asarray(place[:-1], np.float64)

    def on_file(self, places: Places) -> Places:
        """Places on the faces of the surface as places on the faces of the file."""
        out = np.empty_like(places.weights)
        np.put_along_axis(out, self.surface.file_corners[places.face], places.weights, 1)
        return Places(self.surface.source[places.face], out)

    def of_file(self, places: Places) -> Places:
        """Places of the vertices of the surface as those of the vertices of the file; the first corner of the
        first face for vertices that no face uses."""
        found = places.take(np.maximum(self.vertex, 0))
        unused = self.vertex < 0
        found.weights[unused], found.face[unused] = [1.0, 0.0, 0.0], 0
        return found


def map_input_of(mesh: Mesh, name: str, mirrored: bool = False) -> MapInput:
    """Prepare one side of a map. mirrored: read every face the other way round.

    Raises InputError if no face has an area, TopologyError if the mesh is no single surface whose edges
    have two faces at most.
    """
    try:
        surface, report = repair(mesh)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    if mirrored:
        # every face is wound the other way: corners 1 and 2 change places
        turn = np.array([2, 1, 0])
        edges = surface.edges // 3 * 3 + turn[surface.edges % 3]
        edges = np.sort(edges, 1)
        order = np.argsort(edges[:, 0], kind="stable")
        surface = replace(
            surface,
            faces=surface.faces[:, [0, 2, 1]],
            reversed_faces=~surface.reversed_faces,
            edges=edges[order],
            locked=surface.locked[order],
        )
    number, _ = surface.components
    if number != 1:
        raise TopologyError(
            f"{name}: it has {number} connected parts and a map needs one: split the file"
        )
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    genus = int(2 - len(cut_mesh.loops.chart) - cut_mesh.euler()[0]) // 2
    loops = [
        cut_mesh.faces.ravel()[cut_mesh.loops.half_edges[a:b]]
        for a, b in zip(cut_mesh.loops.start[:-1], cut_mesh.loops.start[1:], strict=True)
    ]
    closed = _closed(cut_mesh.faces, surface.vertex_points, loops)
    if not closed.simple:
        raise TopologyError(
            f"{name}: two edges join the same two vertices, so no path is known by its vertices; "
            "subdivide or weld it first"
        )
    vertex = np.full(len(mesh.points), -1)
    solved = surface.corner_vertex
    vertex[surface.from_file(mesh.faces)] = solved
    missing = (vertex < 0) & (report.weld != np.arange(len(vertex)))
    vertex[missing] = vertex[report.weld[missing]]
    notes = list(report.messages)
    return MapInput(name, mesh, surface, closed, loops, vertex, notes, genus)


def _closed(faces: IntArray, points: FloatArray, loops: list[IntArray]) -> ClosedMesh:
    """The surface with a cone over each boundary."""
    m, n = len(faces), len(points)
    tips, cones = [], [faces]
    for k, loop in enumerate(loops):
        after = np.roll(loop, -1)
        length = np.linalg.norm(points[after] - points[loop], axis=1).sum()
        # half of the length away from the middle, which no vertex of the boundary is
        tips.append(points[loop].mean(0) + np.array([0.0, 0.0, length / 2]))
        cones.append(np.stack([after, loop, np.full(len(loop), n + k)], 1))
    whole = np.concatenate(cones)
    return ClosedMesh(
        np.concatenate([points, np.array(tips).reshape(-1, 3)]),
        whole,
        np.where(np.arange(len(whole)) < m, np.arange(len(whole)), -1),
        np.broadcast_to(np.eye(3), (len(whole), 3, 3)).copy(),
        np.arange(len(whole)),
    )


def require_same(a: MapInput, b: MapInput) -> None:
    """Raise TopologyError unless both have as many handles and boundaries."""
    if a.genus != b.genus:
        raise TopologyError(
            f"{a.name} has genus {a.genus} and {b.name} {b.genus}: a map needs the same topology; "
            "see circparam check"
        )
    if len(a.loops) != len(b.loops):
        raise TopologyError(
            f"{a.name} has {counted(len(a.loops), 'boundary')} and {b.name} {len(b.loops)}: "
            "a map needs the same topology; close holes, or cut the other open"
        )
