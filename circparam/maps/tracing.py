"""Paths on one side of a map: shortest, never touching each other, in given sectors of their landmarks."""

from dataclasses import field

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, next_half_edge
from circparam.core.graph import distances, nearest
from circparam.core.records import dataclass
from circparam.maps.closed_mesh import ClosedMesh

FIRST_RADIUS = 1.5  # distances between two landmarks within which a path is looked for at first


@dataclass(frozen=True)
class Traced:
    """A path between two landmarks: vertices (in order), its length, and the sectors that it leaves and enters.

    A sector of a landmark is named by the arc that it follows, counter-clockwise; −1 if there is none yet.
    """

    vertices: IntArray
    length: float
    sectors: tuple[int, int]


@dataclass
class Tracer:
    """The arcs laid so far on one mesh.

    marks (k,): the vertex of each landmark. on (n,): vertices of landmarks and arcs, which no path touches.
    steps[i]: for landmark i, the first vertex of each arc that leaves it → the arc.
    """

    mesh: ClosedMesh
    marks: IntArray
    steps: list[dict[int, int]] = field(default_factory=list)
    arcs: dict[int, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.steps = [{} for _ in self.marks]
        self.on = np.zeros(self.mesh.n, bool)
        self.on[self.marks] = True
        self._prepare()
        self.distance = np.stack([self._distances(int(v)) for v in self.marks])

    def lay(self, arc: int, path: IntArray, i: int, j: int) -> None:
        """Add a path from landmark i to j as arc ``arc``; read backwards it is arc ^ 1."""
        self.arcs[arc], self.arcs[arc ^ 1] = path, path[::-1]
        self.on[path] = True
        self.steps[i][int(path[1])] = arc
        self.steps[j][int(path[-2])] = arc ^ 1

    def take_back(self, arc: int, i: int, j: int) -> None:
        """Take an arc between landmarks i and j away again."""
        del self.arcs[arc], self.arcs[arc ^ 1]
        self._forget(arc, i, j)
        self.mark_arcs()

    def add_landmark(self, vertex: int) -> None:
        """A further landmark, which no path touches from now on."""
        self.marks = np.r_[self.marks, vertex]
        self.steps.append({})
        self.on[vertex] = True
        far = self._distances(vertex)
        self.distance = np.block([[self.distance, far[:-1, None]], [far[None]]])

    def from_arcs(self) -> FloatArray:
        """(n,) distance of each vertex from the nearest arc or landmark, along edges."""
        return distances(self._graph, np.flatnonzero(self.on))

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
        flat = self.mesh.faces.ravel()
        h = np.arange(len(flat))
        chord = self.on[flat] & self.on[flat[next_half_edge(h)]] & ~self.on_arcs()
        chord &= h < self.mesh.twin
        if chord.any():
            self.renew(self.mesh.split(np.flatnonzero(chord))[0])

    def renew(self, mesh: ClosedMesh) -> None:
        """Go on with the mesh after edges were split."""
        self.mesh = mesh
        self.on = np.concatenate([self.on, np.zeros(mesh.n - len(self.on), bool)])
        self._prepare()

    def replace(self, arc: int, path: IntArray, i: int, j: int) -> None:
        """Another path for an arc between the same landmarks, in the same place among the others."""
        self._forget(arc, i, j)
        self.lay(arc, path, i, j)

    def _forget(self, arc: int, i: int, j: int) -> None:
        for at, way in ((i, arc), (j, arc ^ 1)):
            self.steps[at] = {v: name for v, name in self.steps[at].items() if name != way}

    def mark_arcs(self) -> None:
        """Vertices of landmarks and arcs, after arcs were replaced."""
        self.on[:] = False
        self.on[self.marks] = True
        for path in self.arcs.values():
            self.on[path] = True

    def _prepare(self) -> None:
        mesh = self.mesh
        i, j = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
        self._graph = sps.csr_matrix((mesh.edge_lengths, (i, j)), shape=(mesh.n, mesh.n))
        self._row = np.repeat(np.arange(mesh.n), np.diff(self._graph.indptr))

    def _distances(self, vertex: int) -> FloatArray:
        return distances(self._graph, np.array([vertex]))[self.marks]

    def from_landmarks(self) -> FloatArray:
        """(n,) distance of each vertex from the nearest landmark, along edges."""
        return distances(self._graph, self.marks)

    def left_faces(self, regions: list[list[int]]) -> IntArray:
        """(r,) a face of each region, on the left of its first arc; regions: the arcs round each."""
        first = np.array([self.arcs[region[0]][:2] for region in regions]).reshape(-1, 2)
        return self.mesh.half_edges(first[:, 0], first[:, 1]) // 3

    def regions(self, known: list[list[int]]) -> IntArray:
        """(m,) the region of each face; known: the arcs round each region, which lies on their left."""
        label, euler = self.mesh.pieces(self.on_arcs(), self.on)
        name = np.full(len(euler), -1)
        name[label[self.left_faces(known)]] = np.arange(len(known))
        out: IntArray = name[label]
        return out

    def sector_of(self, i: int, step: int) -> int:
        """The sector of landmark i in which its neighbour ``step`` lies."""
        if not self.steps[i]:
            return -1
        ring = self.mesh.ring(int(self.marks[i]))
        at = ring.index(step)
        for back in range(len(ring)):
            arc = self.steps[i].get(ring[at - back])
            if arc is not None:
                return arc
        return -1

    def _allowed(self, i: int, sector: int | None) -> IntArray:
        """Neighbours of landmark i over which a path may leave, in a sector or anywhere."""
        ring = np.array(self.mesh.ring(int(self.marks[i])))
        free = ring[~self.on[ring]]
        if sector is None or sector < 0:
            out: IntArray = free
            return out
        return np.array([v for v in free if self.sector_of(i, int(v)) == sector], np.int64)

    def path(self, i: int, j: int, sectors: tuple[int, int] | None = None) -> Traced | None:
        """The shortest path from landmark i to j that touches no arc, in the given sectors where they are
        given.
        """
        start, end = int(self.marks[i]), int(self.marks[j])
        leave = self._allowed(i, sectors[0] if sectors else None)
        enter = self._allowed(j, sectors[1] if sectors else None)
        if not len(leave) or not len(enter):
            return None
        column = self._graph.indices
        open_ = ~self.on
        usable = open_[self._row] & open_[column]
        rows = slice(self._graph.indptr[start], self._graph.indptr[start + 1])
        usable[rows] = np.isin(column[rows], leave)
        for v in enter:
            own = slice(self._graph.indptr[v], self._graph.indptr[v + 1])
            usable[own] |= column[own] == end
        data = np.where(usable, self._graph.data, np.inf)
        graph = sps.csr_matrix((data, column, self._graph.indptr), shape=self._graph.shape)
        for limit in (FIRST_RADIUS * float(self.distance[i, j]), 1e300):
            distance, before, _ = nearest(graph, np.array([start]), limit)
            if np.isfinite(distance[end]):
                break
        else:
            return None
        out = [end]
        while out[-1] != start:
            out.append(int(before[out[-1]]))
        vertices = np.array(out[::-1], np.int64)
        found = (self.sector_of(i, int(vertices[1])), self.sector_of(j, int(vertices[-2])))
        return Traced(vertices, float(distance[end]), found)
