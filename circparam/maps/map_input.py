"""A mesh as one side of a map: its checks, and the closed mesh that replaces it."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, TopologyError
from circparam.maps.closed_mesh import ClosedMesh
from circparam.maps.surface_map import Places
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.surface import Surface


@dataclass(frozen=True, eq=False)
class MapInput:
    """A connected surface, with or without boundaries.

    name: of the file, or A or B, for messages. surface: in the winding of the solve. closed: the surface with
    closed boundaries, the vertices of the surface first. tips (b,): the vertex that closes each boundary.
    loops: the vertices of each boundary, in order with the surface on the left. vertex (n,): of each vertex of
    the mesh, −1 if no face uses it. notes: repairs.
    """

    name: str
    mesh: Mesh
    surface: Surface
    closed: ClosedMesh
    tips: IntArray
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
    closed, tips = _closed(cut_mesh.faces, surface.vertex_points, loops)
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
    return MapInput(name, mesh, surface, closed, tips, loops, vertex, notes, genus)


def _closed(
    faces: IntArray, points: FloatArray, loops: list[IntArray]
) -> tuple[ClosedMesh, IntArray]:
    """(the surface with a cone over each boundary, (b,) the tip of each)."""
    m, n = len(faces), len(points)
    tips, cones = [], [faces]
    for k, loop in enumerate(loops):
        after = np.roll(loop, -1)
        length = np.linalg.norm(points[after] - points[loop], axis=1).sum()
        # half of the length away from the middle, which no vertex of the boundary is
        tips.append(points[loop].mean(0) + np.array([0.0, 0.0, length / 2]))
        cones.append(np.stack([after, loop, np.full(len(loop), n + k)], 1))
    whole = np.concatenate(cones)
    closed = ClosedMesh(
        np.concatenate([points, np.array(tips).reshape(-1, 3)]),
        whole,
        np.where(np.arange(len(whole)) < m, np.arange(len(whole)), -1),
        np.broadcast_to(np.eye(3), (len(whole), 3, 3)).copy(),
        np.arange(len(whole)),
    )
    return closed, n + np.arange(len(loops))


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
