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
from typing import NamedTuple

import numpy as np

from circparam.core.arrays import IntArray
from circparam.core.graph import cycles
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.errors import TopologyError
from circparam.maps.landmarks import Landmarks
from circparam.maps.map_input import MapInput
from circparam.maps.tracing import Traced, Tracer

QUEUE_SLACK = 1.2  # costs of the next arc in the queue up to which an arc is laid at once


class Both(NamedTuple):
    """The two paths of an arc."""

    a: Traced
    b: Traced

    def cost(self, scales: tuple[float, float]) -> float:
        """Their lengths, each in units of its surface."""
        return self.a.length / scales[0] + self.b.length / scales[1]


def paired(a: Traced | None, b: Traced | None) -> Both | None:
    """Two paths, None if one is missing."""
    return None if a is None or b is None else Both(a, b)


@dataclass
class Layout:
    """A triangulation of k landmarks on two meshes.

    tracers: the arcs on each. ends[arc]: the landmarks that it joins; arc ^ 1 is the same read backwards.
    around[i]: the arcs that leave landmark i, counter-clockwise. scales: of lengths on each. genus: of both.
    """

    tracers: tuple[Tracer, Tracer]
    scales: tuple[float, float]
    genus: int

    def __post_init__(self) -> None:
        k = len(self.tracers[0].marks)
        self.ends: list[tuple[int, int]] = []
        self.around: list[list[int]] = [[] for _ in range(k)]
        self._group = list(range(k))
        self._disks = not self.genus  # whether all regions are disks

    @property
    def k(self) -> int:
        """Number of landmarks."""
        return len(self.around)

    def lay(self, i: int, j: int, both: Both) -> None:
        """Add an arc from landmark i to landmark j."""
        arc = len(self.ends)
        self.ends += [(i, j), (j, i)]
        for at, name, sector in ((i, arc, both.a.sectors[0]), (j, arc ^ 1, both.a.sectors[1])):
            ring = self.around[at]
            ring.insert(ring.index(sector) + 1 if sector >= 0 else 0, name)
        for tracer, path in zip(self.tracers, both, strict=True):
            tracer.lay(arc, path.vertices, i, j)
        old, new = self._group[j], self._group[i]
        self._group = [new if g == old else g for g in self._group]

    def _take_back(self) -> None:
        """Take the arc that was laid last away again; groups stay joined."""
        arc = len(self.ends) - 2
        for at, name in zip(self.ends[arc], (arc, arc ^ 1), strict=True):
            self.around[at].remove(name)
        for tracer in self.tracers:
            tracer.take_back(arc, *self.ends[arc])
        del self.ends[arc:]

    def add_landmark(self, a: int, b: int) -> int:
        """A further pair of vertices, not on any arc; returns its number."""
        for tracer, vertex in zip(self.tracers, (a, b), strict=True):
            tracer.add_landmark(vertex)
        self.around.append([])
        self._group.append(len(self._group))
        return self.k - 1

    def connected(self, i: int, j: int) -> bool:
        """Whether arcs lead from landmark i to j."""
        return self._group[i] == self._group[j]

    def after(self, arc: int) -> int:
        """The arc that follows round the region on the left."""
        j = self.ends[arc][1]
        ring = self.around[j]
        return ring[ring.index(arc ^ 1) - 1]

    def regions(self) -> list[list[int]]:
        """The regions between the arcs: the arcs round each, the region on their left."""
        follower = np.array([self.after(arc) for arc in range(len(self.ends))], np.int64)
        _, order, size = cycles(follower)
        return [r.tolist() for r in np.split(order, np.cumsum(size))[:-1]]

    def lay_known(self, i: int, j: int, a: IntArray, b: IntArray) -> None:
        """Add an arc whose two paths (vertices from landmark i to landmark j) are known."""
        both = Both(
            *(
                Traced(
                    path,
                    0.0,
                    (tracer.sector_of(i, int(path[1])), tracer.sector_of(j, int(path[-2]))),
                )
                for tracer, path in zip(self.tracers, (a, b), strict=True)
            )
        )
        if both.a.sectors != both.b.sectors:
            raise TopologyError(
                f"the paths at landmark {i + 1} or {j + 1} have different orders on the two surfaces: they "
                "would cross; check the paths, or say --mirrored"
            )
        self.lay(i, j, both)

    def lay_shortest(self, i: int, j: int) -> None:
        """Add the shortest paths between two landmarks that touch no arc. Raises TopologyError if there
        is none, or none in the same place among the others."""
        for tracer in self.tracers:
            tracer.split_chords()
        both = self._paths(i, j)
        if both is None:
            raise TopologyError(
                f"the path from landmark {i + 1} to {j + 1} crosses another one on one of the surfaces: "
                "check the order of the paths, or leave it out"
            )
        self.lay(i, j, both)

    def triangulate(self) -> None:
        """Lay arcs until every region is a triangle. Raises TopologyError if no arc can be laid any more."""
        for tracer in self.tracers:
            tracer.split_chords()
        pairs = [(i, j) for i in range(self.k) for j in range(i)]
        laid = {frozenset(e) for e in self.ends}
        pairs = [p for p in pairs if frozenset(p) not in laid]
        self._greedy(pairs, joining=True)
        laid = {frozenset(e) for e in self.ends}
        self._greedy([p for p in pairs if frozenset(p) not in laid], joining=False)
        if self.genus:
            self._require_disks()
            self._fill()
        if any(len(r) != 3 for r in self.regions()):
            raise TopologyError(
                "the landmarks have no common layout, since paths between them cross: check that each line "
                "names the same place on both, or remove the last ones"
            )

    def _greedy(self, pairs: list[tuple[int, int]], joining: bool) -> None:
        """Lay the cheapest pair until none is left; costs only grow as arcs are laid."""
        a, b = self.tracers
        most = 3 * self.k - 6 + 6 * self.genus  # arcs of a triangulation
        queue = [
            (a.distance[i, j] / self.scales[0] + b.distance[i, j] / self.scales[1], i, j)
            for i, j in pairs
        ]
        heapq.heapify(queue)
        while queue and len(self.ends) < 2 * most:
            cost, i, j = heapq.heappop(queue)
            if joining and self.connected(i, j):
                continue
            if not joining and not self._may_meet(i, j):
                continue
            both = self._paths(i, j)
            if both is None:
                continue
            real = both.cost(self.scales)
            if queue and real > QUEUE_SLACK * max(cost, queue[0][0]):
                heapq.heappush(queue, (real, i, j))
                continue
            self.lay(i, j, both)
            if self._disks or self._same_shape():
                for tracer in self.tracers:
                    tracer.split_chords()
            else:
                self._take_back()

    def _may_meet(self, i: int, j: int) -> bool:
        """Whether an arc between two landmarks can be laid: they lie on one disk, or not all regions are."""
        return not self._disks or any(
            {i, j} <= {self.ends[arc][0] for arc in region} for region in self.regions()
        )

    def _paths(self, i: int, j: int) -> Both | None:
        """The cheapest of: both free, one free and the other in the same sectors."""
        a, b = self.tracers
        free = paired(a.path(i, j), b.path(i, j))
        if free is None or free.a.sectors == free.b.sectors:
            return free
        led = (
            paired(free.a, b.path(i, j, free.a.sectors)),
            paired(a.path(i, j, free.b.sectors), free.b),
        )
        return min((x for x in led if x), key=lambda x: x.cost(self.scales), default=None)

    def _same_shape(self) -> bool:
        """Whether the arcs leave the same of both meshes."""
        walks = self.regions()
        first, second = (shape_of(t, walks) for t in self.tracers)
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
        walks = self.regions()
        left = sum((2 - len(own) - euler) // 2 for euler, own in shape_of(self.tracers[0], walks))
        raise TopologyError(
            f"the paths between the landmarks leave {counted(max(left, 1), 'handle')} of {self.genus} uncut: "
            "give three landmarks round and through every handle, or paths (lines 'path 1 2 3 1')"
        )

    def _fill(self) -> None:
        """Cut all disks between the arcs to triangles without a repeated landmark: diagonals, cheapest first. A
        disk without a diagonal gets a landmark inside (a helper) with an arc to every corner."""
        while True:
            regions = [r for r in self.regions() if len(r) > 3]
            if not regions:
                return
            for region in regions:
                if not self._diagonal(region):
                    self._star(region)
                for tracer in self.tracers:
                    tracer.split_chords()

    def _diagonal(self, region: list[int]) -> bool:
        """Lay the cheapest diagonal whose two parts can be cut on; whether there is one."""
        marks = [self.ends[arc][0] for arc in region]
        k, best = len(region), None
        for p, q in itertools.combinations(range(k), 2):
            if q - p < 2 or p + k - q < 2 or marks[p] == marks[q]:
                continue
            if not (_good(marks[p : q + 1]) and _good(marks[q:] + marks[: p + 1])):
                continue
            sectors = region[p], region[q]
            both = paired(*(t.path(marks[p], marks[q], sectors) for t in self.tracers))
            if both is None:
                continue
            cost = both.cost(self.scales)
            if best is None or cost < best[0]:
                best = cost, marks[p], marks[q], both
        if best is None:
            return False
        self.lay(*best[1:])
        return True

    def _star(self, region: list[int]) -> None:
        """A helper inside a region, and an arc from it to every corner."""
        walks = self.regions()
        number = walks.index(region)
        centre = [_deepest(t, t.regions(walks) == number) for t in self.tracers]
        new = self.add_landmark(*centre)
        for arc in region:
            i = self.ends[arc][0]
            sectors = -1, arc
            if self.around[new]:  # after the spoke to the corner before, which the walk has reached
                sectors = self.around[new][-1], arc
            both = paired(*(t.path(new, i, sectors) for t in self.tracers))
            if both is None:
                raise TopologyError(
                    "a region between the paths is too narrow for its meshes: subdivide both surfaces"
                )
            self.lay(new, i, both)
            for tracer in self.tracers:
                tracer.split_chords()


def shape_of(tracer: Tracer, walks: list[list[int]]) -> list[tuple[int, list[int]]]:
    """The pieces of a mesh between its arcs: the Euler characteristic of each, and the walks round it."""
    label, euler = tracer.mesh.pieces(tracer.on_arcs(), tracer.on)
    out: dict[int, list[int]] = {}
    for n, face in enumerate(tracer.left_faces(walks)):
        out.setdefault(int(label[face]), []).append(n)
    return [(int(euler[c]), w) for c, w in out.items()]


def _good(marks: list[int]) -> bool:
    """Whether a polygon with these landmarks can be cut to triangles without a landmark twice, or by a star."""
    return len(marks) > 3 or len(set(marks)) == 3


def _deepest(tracer: Tracer, inside: IntArray) -> int:
    """The vertex of some faces that lies farthest from all arcs."""
    mesh = tracer.mesh
    vertices = np.unique(mesh.faces[inside])
    vertices = vertices[~tracer.on[vertices]]
    if not len(vertices):
        raise TopologyError(
            "a region between the paths has no vertex inside: subdivide both surfaces"
        )
    far = tracer.from_arcs()[vertices]
    return int(vertices[far.argmax()])


def laid_out(a: MapInput, b: MapInput, marks: Landmarks) -> Layout:
    """The common triangulation of the landmarks."""
    layout = begun(a, b, marks)
    layout.triangulate()
    return layout


def begun(a: MapInput, b: MapInput, marks: Landmarks) -> Layout:
    """A layout with its first arcs: boundaries, arcs that close boundaries, arcs that both surfaces have,
    paths."""
    tracers = Tracer(a.closed, np.array(marks.a)), Tracer(b.closed, np.array(marks.b))
    layout = Layout(tracers, (float(np.sqrt(a.area)), float(np.sqrt(b.area))), a.genus)
    for corners, tip in zip(marks.corners, marks.tips, strict=True):
        for i, j in zip(corners, [*corners[1:], corners[0]], strict=True):
            along = (s.along_boundary(v[i], v[j]) for s, v in ((a, marks.a), (b, marks.b)))
            layout.lay_known(i, j, *along)
        for i in corners:
            spokes = (np.array([v[tip], v[i]]) for v in (marks.a, marks.b))
            layout.lay_known(tip, i, *spokes)
    for known in marks.known:
        layout.lay_known(*known)
    for path in marks.paths:
        for i, j in itertools.pairwise(path):
            layout.lay_shortest(i, j)
    return layout
