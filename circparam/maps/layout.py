"""The same triangulation of the landmarks on two surfaces: arcs that do not cross, in the same order round
each.

Arcs are laid on both surfaces together, short ones first (Praun, Sweldens and Schröder 2001, "Consistent mesh
parameterizations"): at first those that join what hangs not yet together, so that no arc closes in
a landmark on one surface alone, then those that cut the regions between the arcs down to triangles. Every arc
leaves and enters its landmarks between the same two arcs on both surfaces, so the two layouts are the
same, whatever the shapes.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import NamedTuple

from circparam.core.arrays import IntArray
from circparam.errors import TopologyError
from circparam.maps.tracing import Traced, Tracer

PATIENCE = 1.2  # an arc that has grown by less than this since it was queued is laid at once


class Both(NamedTuple):
    """The two paths of an arc."""

    a: Traced
    b: Traced

    def cost(self, scales: tuple[float, float]) -> float:
        """Their lengths, each in units of its surface."""
        return self.a.length / scales[0] + self.b.length / scales[1]


@dataclass
class Layout:
    """A triangulation of k landmarks on two sheets.

    tracers: the arcs on each. ends[arc]: the landmarks that it joins; arc ^ 1 is the same read backwards.
    around[i]: the arcs that leave landmark i, counter-clockwise.
    """

    tracers: tuple[Tracer, Tracer]
    scales: tuple[float, float]

    def __post_init__(self) -> None:
        k = len(self.tracers[0].marks)
        self.ends: list[tuple[int, int]] = []
        self.around: list[list[int]] = [[] for _ in range(k)]
        self._group = list(range(k))

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

    def take_back(self) -> None:
        """Take the arc that was laid last away again; what hangs together is told as before."""
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
        seen = [False] * len(self.ends)
        out = []
        for first in range(len(self.ends)):
            if seen[first]:
                continue
            region, arc = [], first
            while not seen[arc]:
                seen[arc] = True
                region.append(arc)
                arc = self.after(arc)
            out.append(region)
        return out

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
                f"the paths at landmark {i + 1} or {j + 1} come in another order on the two surfaces: they "
                "would cross; check the paths, or say --mirrored"
            )
        self.lay(i, j, both)

    def lay_shortest(self, i: int, j: int) -> None:
        """Add the shortest paths between two landmarks that touch no arc. Raises TopologyError where there
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
        """Lay arcs until every region is a triangle. Raises TopologyError where no arc can be laid any more."""
        for tracer in self.tracers:
            tracer.split_chords()
        pairs = [(i, j) for i in range(self.k) for j in range(i)]
        laid = {frozenset(e) for e in self.ends}
        pairs = [p for p in pairs if frozenset(p) not in laid]
        self._greedy(pairs, joining=True)
        laid = {frozenset(e) for e in self.ends}
        self._greedy([p for p in pairs if frozenset(p) not in laid], joining=False)
        self._finish()
        if any(len(r) != 3 for r in self.regions()):
            raise TopologyError(
                "the landmarks have no common layout, since paths between them cross: check that each line "
                "names the same place on both, or remove the last ones"
            )

    def _greedy(self, pairs: list[tuple[int, int]], joining: bool) -> None:
        """Lay what costs least of the pairs, until none is left; costs only grow as arcs are laid."""
        a, b = self.tracers
        queue = [
            (a.distance[i, j] / self.scales[0] + b.distance[i, j] / self.scales[1], i, j)
            for i, j in pairs
        ]
        heapq.heapify(queue)
        while queue and len(self.ends) < 2 * self._most:
            cost, i, j = heapq.heappop(queue)
            if joining and self.connected(i, j):
                continue
            if not joining and not self._may_meet(i, j):
                continue
            both = self._paths(i, j)
            if both is None:
                continue
            real = both.cost(self.scales)
            if queue and real > PATIENCE * max(cost, queue[0][0]):
                heapq.heappush(queue, (real, i, j))
                continue
            if self._lay_if_same(i, j, both):
                for tracer in self.tracers:
                    tracer.split_chords()

    @property
    def _most(self) -> int:
        """Arcs of a triangulation."""
        return 3 * self.k - 6

    def _lay_if_same(self, i: int, j: int, both: Both) -> bool:
        """Lay an arc that does the same to both surfaces, as every one does on spheres."""
        self.lay(i, j, both)
        return True

    def _finish(self) -> None:
        """Cut what the shortest paths have left."""

    def _may_meet(self, i: int, j: int) -> bool:
        """Whether an arc between two landmarks can be laid: they lie on one region."""
        return any({i, j} <= {self.ends[arc][0] for arc in region} for region in self.regions())

    def _paths(self, i: int, j: int) -> Both | None:
        """The cheapest of: both free, one free and the other in the same sectors."""
        a, b = self.tracers
        free_a, free_b = a.path(i, j), b.path(i, j)
        if free_a is None or free_b is None:
            return None
        if free_a.sectors == free_b.sectors:
            return Both(free_a, free_b)
        led_b, led_a = b.path(i, j, free_a.sectors), a.path(i, j, free_b.sectors)
        found = []
        if led_b is not None:
            found.append(Both(free_a, led_b))
        if led_a is not None:
            found.append(Both(led_a, free_b))
        return min(found, key=lambda x: x.cost(self.scales)) if found else None
