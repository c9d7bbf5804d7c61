"""Corresponding charts: the seams of two uv layouts as the same graph on two surfaces.

Nodes are the vertices where three seams meet, or one ends, or a landmark lies; arcs are the seams between them.
The order of the arcs round the nodes is a map of the surface, so one pair of arcs determines all others. Every
pair is tried.
"""

import itertools
from functools import cached_property

import numpy as np

from circparam.core.arrays import group_count, mask_of, next_half_edge
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, IntArray
from circparam.errors import InputError, TopologyError
from circparam.maps.landmarks import Landmarks, close_boundary
from circparam.maps.map_input import MapInput
from circparam.mesh.mesh import UVMap
from circparam.pipeline.verify import uv_seams

Label = tuple[int, int]


@dataclass(frozen=True, eq=False)
class ChartGraph:
    """The seams and boundaries of one side. paths[d]: the vertices of arc d, which leaves the node it begins
    with; d ^ 1 is the same backwards. after[d]: the arc that follows round the chart (or hole) on the left.
    chart (2e,): chart on the left of each arc, −1 for a face that closes a boundary; of_face (m,): of each
    face. mark: node → landmark."""

    side: MapInput
    paths: list[IntArray]
    after: list[int]
    chart: IntArray
    of_face: IntArray
    mark: dict[int, int]

    @cached_property
    def labels(self) -> list[Label]:
        """Labels that tell arcs apart: surface on the left or not, the first landmark."""
        marks = [self.mark.get(int(path[0]), -1) for path in self.paths]
        return list(zip((self.chart >= 0).tolist(), marks, strict=True))

    def line(self) -> str:
        """Counts with their nouns."""
        charts = len(np.unique(self.chart[self.chart >= 0]))
        nodes = len({int(p[0]) for p in self.paths})
        return (
            f"{self.side.name} has {counted(charts, 'chart')}, {counted(len(self.paths) // 2, 'seam')} "
            f"and {counted(nodes, 'node')}"
        )


def add_charts(marks: Landmarks, layouts: tuple[UVMap, UVMap], a: MapInput, b: MapInput) -> None:
    """The seams of both layouts as arcs, and their nodes as helpers, or landmarks where they are some.

    Raises TopologyError if a chart is no disk or the graphs differ, InputError if they correspond in
    several ways.
    """
    first, second = (
        chart_graph(side, layout, vertices)
        for side, layout, vertices in zip((a, b), layouts, (marks.a, marks.b), strict=True)
    )
    found = [x for x in _matches(first, second) if _fits(marks, first, second, x)]
    if not found:
        raise TopologyError(
            f"the charts of the two surfaces do not correspond: {first.line()}, {second.line()}"
            + ("" if not marks.a else "; or the landmarks lie in other charts")
            + ": cut both alike, or map without --charts"
        )
    if len(found) > 1:
        raise InputError(
            f"the charts correspond in {len(found)} ways: give --landmarks with one or two beside a seam until "
            "only one way is left"
        )
    _add(marks, first, second, found[0])


def chart_graph(side: MapInput, layout: UVMap, landmarks: list[int]) -> ChartGraph:
    """The graph of one side. Raises TopologyError if a chart is no disk."""
    mesh, surface = side.closed, side.surface
    m = len(mesh.faces)
    cut = mask_of(3 * m, surface.edges[uv_seams(surface, layout)].ravel())
    outside = np.repeat(mesh.parent < 0, 3)
    cut |= outside != outside[mesh.twin]
    if not cut.any():
        raise TopologyError(f"{side.name}: its uv have no seam: --charts needs both surfaces cut")
    on = mask_of(mesh.n, mesh.faces.ravel()[cut])
    of_face, euler = mesh.pieces(cut, on)
    chains, follower = _traced(side, cut, landmarks)
    flat = mesh.faces.ravel()
    paths = [np.r_[flat[chain], flat[next_half_edge(chain[-1:])]] for chain in chains]
    arc = {int(chain[0]): d for d, chain in enumerate(chains)}
    after = [arc[int(follower[chain[-1]])] for chain in chains]
    left = np.array([chain[0] // 3 for chain in chains])
    chart = np.where(mesh.parent[left] < 0, -1, of_face[left])
    number = {v: k for k, v in enumerate(landmarks)}
    for label in np.unique(of_face[mesh.parent >= 0]).tolist():
        if euler[label] != 1:
            face = int(surface.source[np.flatnonzero(of_face == label)[0]])
            loops = max(2 - int(euler[label]), 0)
            what = "a ring" if loops == 2 else f"not a disk (Euler characteristic {euler[label]})"
            raise TopologyError(
                f"{side.name}: the chart of face {face} is {what}, and --charts needs disks: cut it open"
            )
    return ChartGraph(side, paths, after, chart, of_face, number)


def _traced(
    side: MapInput, cut: BoolArray, landmarks: list[int]
) -> tuple[list[IntArray], IntArray]:
    """(the arcs as chains of cut half-edges between nodes, each beside itself backwards; (3m,) the cut
    half-edge that follows each one round the piece on its left)."""
    mesh = side.closed
    h = np.flatnonzero(cut)
    start = mesh.faces.ravel()[h]
    follower = next_half_edge(np.arange(len(cut)))
    while not cut[follower[h]].all():  # on round the end of each
        follower = np.where(cut[follower], follower, next_half_edge(mesh.twin[follower]))
    degree = group_count(start, mesh.n)
    node = (degree > 0) & (degree != 2)
    node[[v for v in landmarks if degree[v]]] = True
    begins = node[mesh.faces.ravel()]
    used: set[int] = set()
    chains: list[IntArray] = []
    for first in h[np.argsort(start, kind="stable")].tolist():
        if not begins[first] or first in used:
            continue
        chain = [first]
        while not begins[follower[chain[-1]]]:
            chain.append(int(follower[chain[-1]]))
        back = mesh.twin[chain[::-1]]
        used |= {first, int(back[0])}
        chains += [np.array(chain), back]
    if sum(map(len, chains)) != len(h):
        raise TopologyError(
            f"{side.name}: a seam or boundary is a closed loop that meets no other: join it to another seam, "
            "or give a landmark on it"
        )
    return chains, follower


def _matches(a: ChartGraph, b: ChartGraph) -> list[list[int]]:
    """All ways in which the arcs of a go to arcs of b, everything alike."""
    if sorted(a.labels) != sorted(b.labels):
        return []
    rarest = min(a.labels, key=a.labels.count)
    first = a.labels.index(rarest)
    found = [_match(a, b, first, e) for e, label in enumerate(b.labels) if label == rarest]
    return [goes for goes in found if goes is not None]


def _match(a: ChartGraph, b: ChartGraph, d: int, e: int) -> list[int] | None:
    """The arcs of b that those of a go to if arc d goes to e; None if they are not alike."""
    goes = [-1] * len(a.paths)
    goes[d], front = e, [d]
    while front:
        d = front.pop()
        e = goes[d]
        for x, y in ((d ^ 1, e ^ 1), (a.after[d], b.after[e])):
            if goes[x] < 0:
                if a.labels[x] != b.labels[y]:
                    return None
                goes[x] = y
                front.append(x)
            elif goes[x] != y:
                return None
    return goes if sorted(goes) == list(range(len(goes))) else None


def _fits(marks: Landmarks, a: ChartGraph, b: ChartGraph, goes: list[int]) -> bool:
    """Whether every landmark inside a chart lies inside the one that the chart goes to."""
    to = {int(a.chart[d]): int(b.chart[e]) for d, e in enumerate(goes)}
    on = [{int(v) for p in g.paths for v in p} for g in (a, b)]
    for u, v in zip(marks.a, marks.b, strict=True):
        if (u in on[0]) != (v in on[1]):
            return False
        if u not in on[0]:
            own = int(a.of_face[a.side.closed.first_out[u] // 3])
            if to.get(own) != int(b.of_face[b.side.closed.first_out[v] // 3]):
                return False
    return True


def _add(marks: Landmarks, a: ChartGraph, b: ChartGraph, goes: list[int]) -> None:
    """Nodes and arcs into the landmarks; arcs in three where they are loops or lie along boundaries."""
    number = {v: k for k, v in enumerate(marks.a)}
    ends = [(int(p[0]), int(p[-1])) for p in a.paths]
    taken: set[frozenset[int]] = set()
    on_loops: dict[int, list[int]] = {}
    for d in range(0, len(ends), 2):
        one, two = a.paths[d], b.paths[goes[d]]
        for v, w in ((one[0], two[0]), (one[-1], two[-1])):
            if int(v) not in number:
                number[int(v)] = marks.add(int(v), int(w), False)
        rim = a.chart[d] < 0 or a.chart[d ^ 1] < 0
        pair = frozenset(ends[d])
        parts = 3 if len(pair) == 1 or rim else 2 if pair in taken else 1
        taken.add(pair)
        cut_a, cut_b = (g.side.closed.divided(p, parts) for g, p in ((a, one), (b, two)))
        marked = [
            marks.add(int(one[x]), int(two[y]), False) for x, y in zip(cut_a, cut_b, strict=True)
        ]
        along = [number[ends[d][0]], *marked, number[ends[d][1]]]
        if rim:
            on_loops.setdefault(int(a.side.on_boundary[one[1]]), []).extend(along)
            continue
        for k, (x, y) in enumerate(zip(_pieces(one, cut_a), _pieces(two, cut_b), strict=True)):
            marks.known.append((along[k], along[k + 1], x, y))
    for k, loop in enumerate(a.side.loops):
        order = loop.tolist()
        corners = sorted(set(on_loops[k]), key=lambda c: order.index(marks.a[c]))
        partner = int(b.side.on_boundary[marks.b[corners[0]]])
        close_boundary(marks, (a.side, b.side), (k, partner), corners)


def _pieces(path: IntArray, cut: IntArray) -> list[IntArray]:
    """A path in pieces that share their ends."""
    at = [0, *cut.tolist(), len(path) - 1]
    return [path[i : j + 1] for i, j in itertools.pairwise(at)]
