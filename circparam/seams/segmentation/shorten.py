"""Shorten seams: every chain between two junctions becomes a shortest path inside a band round it."""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.graph import nearest, undirected
from circparam.core.records import dataclass
from circparam.mesh.atlas import Atlas
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.paths import Bands, Chains, chains_of, route


def bands(
    ends: tuple[IntArray, IntArray], n: int, chains: Chains, closed: BoolArray, rings: int
) -> tuple[IntArray, FloatArray]:
    """Vertices within ``rings`` edges of a chain, each given to the nearest: (owner (n,), value (n,)).

    closed: (n,) bool, vertices that no band may hold (boundaries and junctions).
    """
    blocked = closed.copy()
    blocked[chains.start] = blocked[chains.end] = True
    owner = np.full(n, -1)
    value = np.zeros(n)
    owner[chains.vertex] = chains.chain
    value[chains.vertex] = chains.position
    open_edge = ~blocked[ends[0]] & ~blocked[ends[1]]
    a, b = ends[0][open_edge], ends[1][open_edge]
    if len(chains.vertex) and len(a):
        _, _, source = nearest(undirected(n, a, b, np.ones(len(a))), chains.vertex, rings)
        reached = (source >= 0) & ~blocked
        owner[reached] = owner[source[reached]]
        value[reached] = value[source[reached]]
    return owner, value


@dataclass(frozen=True, eq=False)
class Proposal:
    """Shorter seams, chain by chain, so that single chains can be taken or left.

    old, new: (e,) chain whose path follows the edge before and after, −1 for none. kept: (e,) bool, seams that
    are in no chain. n: number of chains.
    """

    old: IntArray
    new: IntArray
    kept: BoolArray
    n: int

    def cut(self, take: BoolArray) -> BoolArray:
        """(e,) seams when the chains ``take`` ((n,) bool) move and the others stay."""
        take = np.r_[take, False]  # the last entry stands for −1
        stay = np.r_[~take[:-1], False]
        result: BoolArray = self.kept | take[self.new] | stay[self.old]
        return result

    def costs(self, cost: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) what the old and the new path of every chain cost; cost: (e,) of each edge."""
        now, then = (np.flatnonzero(path >= 0) for path in (self.old, self.new))
        return (
            group_sum(cost[now], self.old[now], self.n),
            group_sum(cost[then], self.new[then], self.n),
        )

    def beside(self, edges: BoolArray) -> BoolArray:
        """(n,) bool: chains whose old or new path follows one of those edges ((e,) bool)."""
        out = np.zeros(self.n + 1, bool)  # the last entry stands for −1
        out[self.new[edges]] = True
        out[self.old[edges]] = True
        return out[:-1]


def propose(
    atlas: Atlas,
    rings: int = 2,
    pinned: BoolArray | None = None,
    pieces: tuple[int, int] | None = None,
) -> Proposal:
    """Shorten all seams inside bands of ``rings`` edges; junctions and ends on boundaries stay.

    pinned: (e,) bool, seams that stay as they are (sharp edges, seams the user asked for). pieces: (k, i),
    chains end at their i-th vertex as well, and at every k-th after it. The bands are
    disjoint, so any choice of moved and unmoved chains is free of crossings.
    """
    n_edges = len(atlas.cut)
    kept = np.zeros(n_edges, bool) if pinned is None else pinned & atlas.cut
    move = np.flatnonzero(atlas.cut & ~kept)
    old, new = np.full(n_edges, -1), np.full(n_edges, -1)
    if len(move) == 0:
        return Proposal(old, new, kept, 0)
    a, b = atlas.ends
    n = atlas.n_vertices
    stop = atlas.on_boundary.copy()
    stop[a[kept]] = stop[b[kept]] = True
    chains = chains_of(a[move], b[move], n, stop)
    if pieces is not None:
        stop[chains.vertex[chains.position % pieces[0] == pieces[1]]] = True
        chains = chains_of(a[move], b[move], n, stop)
    owner, value = bands(atlas.ends, n, chains, stop, rings)
    cost = edge_costs(atlas)
    usable = np.flatnonzero(np.isfinite(cost) & ~kept)
    where = Bands((a[usable], b[usable]), cost[usable], owner, value)
    routes = route(where, chains.start, chains.end, chains.size)
    of_vertex = np.full(n, -1)
    of_vertex[chains.vertex] = chains.chain
    old[move] = np.maximum(of_vertex[a[move]], of_vertex[b[move]])
    # a chain of one edge between two junctions has no vertex of its own and cannot get shorter
    kept = kept.copy()
    kept[move[old[move] < 0]] = True
    new[usable[routes.edges]] = routes.chain
    failed = np.isin(old, routes.failed) & (old >= 0)
    new[failed] = old[failed]
    new[kept] = -1
    return Proposal(old, new, kept, len(chains.start))
