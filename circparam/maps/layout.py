"""The same triangulation of the landmarks on two surfaces: arcs that do not cross, in the same order round
each.

Arcs are laid on both surfaces together, short ones first (Praun, Sweldens and Schröder 2001, "Consistent mesh
parameterizations"). The first arcs join separate parts, so no arc closes in a landmark on one surface alone.
The next arcs cut the regions down to triangles. Every arc leaves and enters its landmarks between the same two
arcs on both surfaces, so the two layouts are the same, whatever the shapes.

On a sphere every region between connected arcs is a disk. With handles an arc may cut a region apart on one
surface and open a handle on the other. Arcs are kept only if they do the same to both.
"""

import heapq
import itertools
from dataclasses import field
from typing import TypeAlias

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import ends_of, mask_of, positions_in
from circparam.core.graph import components, cycles, distances, nearest
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, IntArray
from circparam.errors import TopologyError
from circparam.maps.landmarks import Landmarks
from circparam.maps.map_input import ClosedMesh, MapInput

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
        one_each = np.split(self.marks, len(self.marks))
        self.distance = np.stack([distances(self._graph, v)[self.marks] for v in one_each])

    def renew(self, mesh: ClosedMesh) -> None:
        """Go on with the mesh after edges were split."""
        self.mesh = mesh
        i, j = ends_of(mesh.faces, np.arange(len(mesh.twin)))
        length = np.linalg.norm(mesh.points[j] - mesh.points[i], axis=1) / self.unit
        self._graph = sps.csr_matrix((length, (i, j)), shape=(mesh.n, mesh.n))
        self._row = np.repeat(np.arange(mesh.n), np.diff(self._graph.indptr))

    def lay(self, arc: int, path: IntArray) -> None:
        """Lay an arc, in place of the path that it had."""
        self.arcs[arc], self.arcs[arc ^ 1] = path, path[::-1]

    def add_landmark(self, vertex: int) -> None:
        """A further landmark, which no path touches from now on."""
        self.marks = np.r_[self.marks, vertex]
        far = distances(self._graph, self.marks[-1:])[self.marks]
        self.distance = np.block([[self.distance, far[:-1, None]], [far[None]]])

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
        h = np.arange(len(self.mesh.twin))
        start, end = self.on[np.stack(ends_of(self.mesh.faces, h))]
        chord = start & end & ~self.on_arcs() & (h < self.mesh.twin)
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

    def _pieces(self, walks: list[list[int]]) -> tuple[IntArray, IntArray, IntArray]:
        """(piece (m,) of each face between the arcs, the Euler characteristic of each piece, the piece on the
        left of each walk along arcs)."""
        label, euler = self.mesh.pieces(self.on_arcs(), self.on)
        first = np.array([self.arcs[walk[0]][:2] for walk in walks]).reshape(-1, 2)
        return label, euler, label[self.mesh.half_edges(*first.T) // 3]

    def regions(self, known: list[list[int]]) -> IntArray:
        """(m,) the region of each face; known: the arcs round each region, which lies on their left."""
        label, euler, left = self._pieces(known)
        return positions_in(len(euler), left)[label]

    def shapes(self, walks: list[list[int]]) -> list[tuple[int, list[int]]]:
        """The pieces of the mesh between the arcs: the Euler characteristic of each, and the walks round it."""
        _, euler, left = self._pieces(walks)
        out: dict[int, list[int]] = {}
        for n, piece in enumerate(left.tolist()):
            out.setdefault(piece, []).append(n)
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
        ends = [
            [v for v, own in self._sectors(k).items() if free[v] and sector in (-1, own)]
            for k, sector in zip((i, j), sectors, strict=True)
        ]
        if not all(ends):
            return None
        leave, enter = (mask_of(self.mesh.n, np.array(v)) for v in ends)
        graph, row, column = self._graph, self._row, self._graph.indices
        usable = free[row] & free[column]
        usable |= (row == start) & leave[column] | (column == end) & enter[row]
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


Both: TypeAlias = tuple[Traced, Traced]


@dataclass
class Layout:
    """A triangulation of k landmarks on two meshes.

    tracers: the arcs on each. genus: of both. ends[arc]: the landmarks that it joins; arc ^ 1 is the same read
    backwards. around[i]: the arcs that leave landmark i, counter-clockwise.
    """

    tracers: tuple[Tracer, Tracer]
    genus: int
    ends: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.around: list[list[int]] = [[] for _ in self.tracers[0].marks]
        self._disks = not self.genus  # whether all regions are disks

    @property
    def k(self) -> int:
        """Number of landmarks."""
        return len(self.around)

    def lay(self, i: int, j: int, both: Both) -> None:
        """Add an arc from landmark i to landmark j."""
        arc = len(self.ends)
        self.ends += [(i, j), (j, i)]
        for at, name, sector in zip((i, j), (arc, arc ^ 1), both[0].sectors, strict=True):
            ring = self.around[at]
            ring.insert(ring.index(sector) + 1 if sector >= 0 else 0, name)
        for tracer, path in zip(self.tracers, both, strict=True):
            tracer.lay(arc, path.vertices)

    def _take_back(self) -> None:
        """Take the arc that was laid last away again."""
        arc = len(self.ends) - 2
        for at, name in zip(self.ends[arc], (arc, arc ^ 1), strict=True):
            self.around[at].remove(name)
            for tracer in self.tracers:
                del tracer.arcs[name]
        del self.ends[arc:]

    def split_chords(self) -> None:
        """Open the way between all arcs on both meshes."""
        for tracer in self.tracers:
            tracer.split_chords()

    def after(self, arc: int) -> int:
        """The arc that follows round the region on the left."""
        ring = self.around[self.ends[arc][1]]
        return ring[ring.index(arc ^ 1) - 1]

    def regions(self) -> list[list[int]]:
        """The regions between the arcs: the arcs round each, the region on their left."""
        _, order, size = self._cycles()
        return [r.tolist() for r in np.split(order, np.cumsum(size))[:-1]]

    def region_of(self) -> IntArray:
        """(2e,) the region on the left of each arc."""
        return self._cycles()[0]

    def _cycles(self) -> tuple[IntArray, IntArray, IntArray]:
        return cycles(np.array([self.after(arc) for arc in range(len(self.ends))], np.int64))

    def lay_known(self, i: int, j: int, a: IntArray, b: IntArray) -> None:
        """Add an arc whose two paths (vertices from landmark i to landmark j) are known."""
        one, two = (t.traced(i, j, path) for t, path in zip(self.tracers, (a, b), strict=True))
        if one.sectors != two.sectors:
            raise TopologyError(
                f"the paths at landmark {i + 1} or {j + 1} have different orders on the two surfaces: they "
                "would cross; check the paths, or say --mirrored"
            )
        self.lay(i, j, (one, two))

    def lay_shortest(self, i: int, j: int) -> None:
        """Add the shortest paths between two landmarks that touch no arc. Raises TopologyError if there
        is none, or none in the same place among the others."""
        self.split_chords()
        both = self._paths(i, j)
        if both is None:
            raise TopologyError(
                f"the path from landmark {i + 1} to {j + 1} crosses another one on one of the surfaces: "
                "check the order of the paths, or leave it out"
            )
        self.lay(i, j, both)

    def triangulate(self) -> None:
        """Lay arcs until every region is a triangle. Raises TopologyError if no arc can be laid any more."""
        self.split_chords()
        self._greedy(joining=True)
        self._greedy(joining=False)
        if self.genus:
            self._require_disks()
        few = self.k == 3 and not self.genus  # a polyhedron has four corners or more
        for region in self.regions():
            large = len(region) > 3 if self.genus else few
            if large and not self._star(region) and self.genus:
                raise TopologyError(
                    "a region between the paths has no vertex inside: subdivide both surfaces"
                )
        if any(len(r) != 3 for r in self.regions()):
            raise TopologyError(
                "the landmarks have no common layout, since paths between them cross: check that each line "
                "names the same place on both, or remove the last ones"
            )

    def _greedy(self, joining: bool) -> None:
        """Lay the cheapest pair until none is left; costs only grow as arcs are laid.

        joining: between parts that no arc joins yet; else wherever an arc cuts a region.
        """
        most = 3 * self.k - 6 + 6 * self.genus  # arcs of a triangulation
        laid = {frozenset(e) for e in self.ends}
        queue = [
            (sum(float(t.distance[i, j]) for t in self.tracers), i, j)
            for i in range(self.k)
            for j in range(i)
            if frozenset((i, j)) not in laid
        ]
        heapq.heapify(queue)
        while queue and len(self.ends) < 2 * most:
            _, i, j = heapq.heappop(queue)
            if joining:
                part = components(self.k, *np.array(self.ends).reshape(-1, 2).T)[1]
                useless = part[i] == part[j]
            else:  # where all regions are disks, an arc joins landmarks of one of them
                corners = [{self.ends[arc][0] for arc in region} for region in self.regions()]
                useless = self._disks and not any({i, j} <= own for own in corners)
            if useless:
                continue
            both = self._paths(i, j)
            if both is None:
                continue
            cost = _cost(both)
            if queue and cost > queue[0][0]:
                heapq.heappush(queue, (cost, i, j))
                continue
            self.lay(i, j, both)
            if self._disks or self._same_shape():
                self.split_chords()
            else:
                self._take_back()

    def _paths(self, i: int, j: int, sectors: tuple[int, int] | None = None) -> Both | None:
        """The shortest paths on both in the given sectors; else the cheapest of: both free, one free and the
        other in the same sectors. None if one is missing."""
        a, b = self.tracers
        one, two = (t.path(i, j, sectors or (-1, -1)) for t in self.tracers)
        if one is None or two is None:
            return None
        if sectors or one.sectors == two.sectors:
            return one, two
        led = (one, b.path(i, j, one.sectors)), (a.path(i, j, two.sectors), two)
        return min(((x, y) for x, y in led if x and y), key=_cost, default=None)

    def _same_shape(self) -> bool:
        """Whether the arcs leave the same of both meshes."""
        walks = self.regions()
        first, second = (t.shapes(walks) for t in self.tracers)
        self._disks = all(euler == 1 and len(own) == 1 for euler, own in first + second)
        return first == second

    def _require_disks(self) -> None:
        """Raise TopologyError if handles are left uncut, or the paths cut them otherwise."""
        if not self._same_shape():
            raise TopologyError(
                "the paths cut one surface apart and not the other: "
                "check that each names the same places on both"
            )
        if self._disks:
            return
        pieces = self.tracers[0].shapes(self.regions())
        left = sum((2 - len(own) - euler) // 2 for euler, own in pieces)
        raise TopologyError(
            f"the paths between the landmarks leave {counted(max(left, 1), 'handle')} of {self.genus} uncut: "
            "give three landmarks round and through every handle, or paths (lines 'path 1 2 3 1')"
        )

    def _star(self, region: list[int]) -> bool:
        """A helper inside a region, and an arc from it to every corner; whether both have a vertex inside."""
        walks = self.regions()
        number = walks.index(region)
        centre = [t.deepest(t.regions(walks) == number) for t in self.tracers]
        if min(centre) < 0:
            return False
        for tracer, vertex in zip(self.tracers, centre, strict=True):
            tracer.add_landmark(vertex)
        self.around.append([])
        new, spoke = self.k - 1, -1
        for arc in region:
            i = self.ends[arc][0]
            both = self._paths(new, i, (spoke, arc))
            if both is None:
                raise TopologyError(
                    "a region between the paths is too narrow for its meshes: subdivide both surfaces"
                )
            spoke = len(self.ends)  # the next one follows it, as the walk does
            self.lay(new, i, both)
            self.split_chords()
        return True


def _cost(both: Both) -> float:
    """The lengths of the two paths of an arc, each in units of its surface."""
    return both[0].length + both[1].length


def laid_out(a: MapInput, b: MapInput, marks: Landmarks) -> Layout:
    """The common triangulation of the landmarks. First come arcs that both surfaces have, then paths."""
    one, two = (
        Tracer(side.closed, np.array(own), float(np.sqrt(side.area)))
        for side, own in ((a, marks.a), (b, marks.b))
    )
    layout = Layout((one, two), a.genus)
    for known in marks.known:
        layout.lay_known(*known)
    for path in marks.paths:
        for i, j in itertools.pairwise(path):
            layout.lay_shortest(i, j)
    layout.triangulate()
    return layout
