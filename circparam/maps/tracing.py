"""Paths on one side of a map: shortest, never touching each other, in given sectors of their landmarks."""

from dataclasses import field

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import mask_of, next_half_edge, positions_in
from circparam.core.graph import distances, nearest
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.maps.closed_mesh import ClosedMesh

# distances between two landmarks within which a path is looked for at first
FIRST_RADIUS_DISTANCES = 1.5


@dataclass(frozen=True)
class Traced:
    """A path between two landmarks: vertices (in order), its length, and the sectors that it leaves and enters.

    A sector of a landmark is named by the arc that it follows, counter-clockwise; −1 if there is none yet.
    Lengths are in units of the surface.
    """

    vertices: IntArray
    length: float
    sectors: tuple[int, int]


@dataclass
class Tracer:
    """The arcs laid so far on one mesh.

    marks (k,): the vertex of each landmark. unit: of lengths. arcs: the vertices of each; arc ^ 1 is the same
    read backwards.
    """

    mesh: ClosedMesh
    marks: IntArray
    unit: float
    arcs: dict[int, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.renew(self.mesh)
        self.distance = np.stack([self._distances(int(v)) for v in self.marks])

    def renew(self, mesh: ClosedMesh) -> None:
        """Go on with the mesh after edges were split."""
        self.mesh = mesh
        i, j = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
        length = np.linalg.norm(mesh.points[j] - mesh.points[i], axis=1) / self.unit
        self._graph = sps.csr_matrix((length, (i, j)), shape=(mesh.n, mesh.n))
        self._row = np.repeat(np.arange(mesh.n), np.diff(self._graph.indptr))

    def lay(self, arc: int, path: IntArray) -> None:
        """Lay an arc, in place of the path that it had."""
        self.arcs[arc], self.arcs[arc ^ 1] = path, path[::-1]

    def add_landmark(self, vertex: int) -> None:
        """A further landmark, which no path touches from now on."""
        self.marks = np.r_[self.marks, vertex]
        far = self._distances(vertex)
        self.distance = np.block([[self.distance, far[:-1, None]], [far[None]]])

    def _distances(self, vertex: int) -> FloatArray:
        return distances(self._graph, np.array([vertex]))[self.marks]

    @property
    def on(self) -> BoolArray:
        """(n,) bool: vertices of landmarks and arcs, which no path touches."""
        return mask_of(self.mesh.n, np.concatenate([self.marks, *self.arcs.values()]))

    def on_arcs(self) -> BoolArray:
        """(3m,) bool: half-edges that lie on an arc."""
        out = np.zeros(3 * len(self.mesh.faces), bool)
        if self.arcs:
            start = np.concatenate([p[:-1] for p in self.arcs.values()])
            end = np.concatenate([p[1:] for p in self.arcs.values()])
            out[self.mesh.half_edges(start, end)] = True
        return out

    def split_chords(self) -> None:
        """Split every edge that joins two vertices of arcs and is on none, so that paths pass between all
        arcs.
        """
        flat, on = self.mesh.faces.ravel(), self.on
        h = np.arange(len(flat))
        chord = on[flat] & on[flat[next_half_edge(h)]] & ~self.on_arcs()
        chord &= h < self.mesh.twin
        if chord.any():
            self.renew(self.mesh.split(np.flatnonzero(chord))[0])

    def deepest(self, inside: BoolArray) -> int:
        """The vertex of some faces ((m,) bool) that lies farthest from arcs and landmarks, −1 if there is
        none off them."""
        on = self.on
        vertices = np.unique(self.mesh.faces[inside])
        vertices = vertices[~on[vertices]]
        if not len(vertices):
            return -1
        far = distances(self._graph, np.flatnonzero(on))[vertices]
        return int(vertices[far.argmax()])

    def left_faces(self, regions: list[list[int]]) -> IntArray:
        """(r,) a face of each region, on the left of its first arc; regions: the arcs round each."""
        first = np.array([self.arcs[region[0]][:2] for region in regions]).reshape(-1, 2)
        return self.mesh.half_edges(first[:, 0], first[:, 1]) // 3

    def regions(self, known: list[list[int]]) -> IntArray:
        """(m,) the region of each face; known: the arcs round each region, which lies on their left."""
        label, euler = self.mesh.pieces(self.on_arcs(), self.on)
        return positions_in(len(euler), label[self.left_faces(known)])[label]

    def shapes(self, walks: list[list[int]]) -> list[tuple[int, list[int]]]:
        """The pieces of the mesh between the arcs: the Euler characteristic of each, and the walks round it."""
        label, euler = self.mesh.pieces(self.on_arcs(), self.on)
        out: dict[int, list[int]] = {}
        for n, face in enumerate(self.left_faces(walks)):
            out.setdefault(int(label[face]), []).append(n)
        return [(int(euler[c]), w) for c, w in out.items()]

    def _sectors(self, i: int) -> dict[int, int]:
        """The sector of landmark i in which each of its neighbours lies, counter-clockwise."""
        ring = self.mesh.ring(int(self.marks[i]))
        leaves = {int(p[1]): arc for arc, p in self.arcs.items() if p[0] == self.marks[i]}
        out, sector = {}, -1
        # the last arc of the first turn is the sector of the first neighbours
        for vertex in ring * 2:
            sector = leaves.get(vertex, sector)
            out[vertex] = sector
        return out

    def traced(self, i: int, j: int, vertices: IntArray, length: float = 0.0) -> Traced:
        """A path from landmark i to j, with its sectors."""
        leaves, enters = self._sectors(i)[int(vertices[1])], self._sectors(j)[int(vertices[-2])]
        return Traced(vertices, length, (leaves, enters))

    def path(self, i: int, j: int, sectors: tuple[int, int] = (-1, -1)) -> Traced | None:
        """The shortest path from landmark i to j that touches no arc, in the given sectors; −1 is any."""
        start, end = int(self.marks[i]), int(self.marks[j])
        free = ~self.on
        leave, enter = (
            [v for v, own in self._sectors(k).items() if free[v] and sector in (-1, own)]
            for k, sector in zip((i, j), sectors, strict=True)
        )
        if not leave or not enter:
            return None
        graph, column = self._graph, self._graph.indices
        usable = free[self._row] & free[column]
        rows = slice(graph.indptr[start], graph.indptr[start + 1])
        usable[rows] = np.isin(column[rows], leave)
        for v in enter:
            own = slice(graph.indptr[v], graph.indptr[v + 1])
            usable[own] |= column[own] == end
        data = np.where(usable, graph.data, np.inf)
        graph = sps.csr_matrix((data, column, graph.indptr), shape=graph.shape)
        for limit in (FIRST_RADIUS_DISTANCES * float(self.distance[i, j]), 1e300):
            distance, before, _ = nearest(graph, np.array([start]), limit)
            if np.isfinite(distance[end]):
                break
        else:
            return None
        out = [end]
        while out[-1] != start:
            out.append(int(before[out[-1]]))
        return self.traced(i, j, np.array(out[::-1], np.int64), float(distance[end]))
