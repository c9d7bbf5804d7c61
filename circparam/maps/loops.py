"""Surfaces with handles: arcs that cut both into disks in the same way, and those disks into triangles.

On a sphere every region between connected arcs is a disk, so the order of the arcs round the landmarks
tells all. With handles an arc may cut a region apart on one surface and open a handle on the other: arcs
are kept only where they do the same to both.
"""

from __future__ import annotations

import itertools

import numpy as np

from circparam.core.arrays import IntArray, group_count
from circparam.core.graph import components
from circparam.core.words import counted
from circparam.errors import TopologyError
from circparam.maps.layout import Both, Layout
from circparam.maps.tracing import Tracer

Shape = list[
    tuple[int, list[int]]
]  # of each component between the arcs: Euler characteristic, walks


def shape_of(tracer: Tracer, walks: list[list[int]]) -> Shape:
    """What the arcs leave of a sheet: of every component its Euler characteristic and the walks round it."""
    sheet = tracer.sheet
    twin = sheet.twin
    open_ = ~tracer.on_arcs()
    h = np.flatnonzero(open_)
    count, label = components(len(sheet.faces), h // 3, twin[h] // 3)
    edges = group_count(label[h // 3], count) // 2
    inner = ~tracer.on
    vertices = group_count(label[sheet.first_out[inner] // 3], count)
    euler = group_count(label, count) - edges + vertices
    out: dict[int, list[int]] = {}
    for n, walk in enumerate(walks):
        path = tracer.arcs[walk[0]]
        half_edge = int(sheet.half_edges(path[:1], path[1:2])[0])
        out.setdefault(int(label[half_edge // 3]), []).append(n)
    return [(int(euler[c]), w) for c, w in out.items()]


class HandleLayout(Layout):
    """A layout on surfaces with handles."""

    genus = 1

    @property
    def _most(self) -> int:
        return 3 * self.k - 6 + 6 * self.genus

    def same_shape(self) -> bool:
        """Whether the arcs leave the same of both sheets."""
        walks = self.regions()
        first, second = (shape_of(t, walks) for t in self.tracers)
        self._disks = all(euler == 1 and len(own) == 1 for euler, own in first + second)
        return first == second

    def __post_init__(self) -> None:
        super().__post_init__()
        self._disks = False

    def _may_meet(self, i: int, j: int) -> bool:
        return not self._disks or super()._may_meet(i, j)

    def _lay_if_same(self, i: int, j: int, both: Both) -> bool:
        self.lay(i, j, both)
        if self._disks or self.same_shape():
            return True
        self.take_back()
        return False

    def _finish(self) -> None:
        self.require_disks()
        fill(self)

    def require_disks(self) -> None:
        """Raise TopologyError where handles are left uncut, or the paths cut them otherwise."""
        if not self.same_shape():
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


def fill(layout: Layout) -> None:
    """Cut all disks between the arcs to triangles without a landmark twice: diagonals, cheapest first; what
    has none gets a landmark inside (a helper) with an arc to every corner."""
    while True:
        regions = [r for r in layout.regions() if len(r) > 3]
        if not regions:
            return
        for region in regions:
            if not _diagonal(layout, region):
                _star(layout, region)
            for tracer in layout.tracers:
                tracer.split_chords()


def _diagonal(layout: Layout, region: list[int]) -> bool:
    """Lay the cheapest diagonal whose two parts can be cut on; whether there is one."""
    marks = [layout.ends[arc][0] for arc in region]
    k, best = len(region), None
    for p, q in itertools.combinations(range(k), 2):
        if q - p < 2 or p + k - q < 2 or marks[p] == marks[q]:
            continue
        if not (_good(marks[p : q + 1]) and _good(marks[q:] + marks[: p + 1])):
            continue
        sectors = region[p], region[q]
        found = [t.path(marks[p], marks[q], sectors) for t in layout.tracers]
        if found[0] is None or found[1] is None:
            continue
        both = Both(found[0], found[1])
        cost = both.cost(layout.scales)
        if best is None or cost < best[0]:
            best = cost, marks[p], marks[q], both
    if best is None:
        return False
    layout.lay(*best[1:])
    return True


def _good(marks: list[int]) -> bool:
    """Whether a polygon with these landmarks can be cut to triangles without a landmark twice, or by a star."""
    return len(marks) > 3 or len(set(marks)) == 3


def _star(layout: Layout, region: list[int]) -> None:
    """A helper inside a region, and an arc from it to every corner."""
    walks = layout.regions()
    number = walks.index(region)
    centre = [_deepest(t, t.regions(walks) == number) for t in layout.tracers]
    new = layout.add_landmark(*centre)
    for arc in region:
        i = layout.ends[arc][0]
        sectors = -1, arc
        if layout.around[new]:  # after the spoke to the corner before, which the walk has reached
            sectors = layout.around[new][-1], arc
        found = [t.path(new, i, sectors) for t in layout.tracers]
        if found[0] is None or found[1] is None:
            raise TopologyError(
                "a region between the paths is too narrow for its meshes: subdivide both surfaces"
            )
        layout.lay(new, i, Both(found[0], found[1]))
        for tracer in layout.tracers:
            tracer.split_chords()


def _deepest(tracer: Tracer, inside: IntArray) -> int:
    """The vertex of some faces that lies farthest from all arcs."""
    sheet = tracer.sheet
    vertices = np.unique(sheet.faces[inside])
    vertices = vertices[~tracer.on[vertices]]
    if not len(vertices):
        raise TopologyError(
            "a region between the paths has no vertex inside: subdivide both surfaces"
        )
    far = tracer.from_arcs()[vertices]
    return int(vertices[far.argmax()])
