"""Transfer of seams from a coarse surface to the fine one."""

import dataclasses

import numpy as np

from circparam.core.arrays import (
    edge_keys,
    first_of_groups,
    found_in,
    group_count,
    mask_of,
    positions_in,
)
from circparam.core.graph import Graph, nearest, undirected
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.seams.multires.decimate import Proxy
from circparam.seams.prices import crease_costs
from circparam.seams.segmentation.paths import Bands, Chains, bands, chains_of, route, spread

STRAY_CELLS = (0, 2)  # cells beside a seam's own that its path may use, attempt by attempt
# from a surface with hardly fewer faces, along whose edges paths would zigzag
STRAY_CELLS_OF_LEVEL = 1, 0, 2


def transfer_seams(
    coarse: Atlas, proxy: Proxy, fine: Atlas, rings: tuple[int, ...] = STRAY_CELLS
) -> int:
    """Cut the fine surface along shortest paths in the cells of the coarse seams; returns paths not found.

    rings: cells beside a seam's own that its path may use, attempt by attempt.
    """
    surface = coarse.surface
    n = len(surface.points)
    flat = surface.faces.ravel()
    h = surface.edges[coarse.cut, 0]
    along = surface.faces[:, [1, 2, 0]].ravel()
    a, b = np.r_[flat[h], proxy.apart[:, 0]], np.r_[along[h], proxy.apart[:, 1]]
    fine.cut = np.zeros(len(fine.cut), bool)
    if len(a) == 0:
        return 0
    boundary = mask_of(n, np.r_[flat[surface.boundary], along[surface.boundary]])
    boundary[proxy.apart.ravel()] = False
    chains = chains_of(a, b, n, boundary)
    router = _Router(fine, proxy, (flat, along), boundary, chains)
    left = chains
    if rings[0] > 0:  # where nothing was decimated, seams are taken over as they are
        single = group_count(proxy.cell[proxy.cell >= 0], n) == 1
        own = single[chains.start] & single[chains.end]
        own[chains.chain[~single[chains.vertex]]] = False
        found = router.cut(_some_chains(chains, np.flatnonzero(own)), 0)
        left = _joined(_some_chains(chains, np.flatnonzero(~own)), found)
    for wide in rings:
        left = router.cut(left, wide)
    return sum(not router.find_way(k) for k in zip(left.start, left.end, strict=True))


class _Router:
    """Cuts paths on the fine surface, each in the cells of a chain of coarse vertices."""

    def __init__(
        self,
        fine: Atlas,
        proxy: Proxy,
        coarse_ends: tuple[IntArray, IntArray],
        boundary: BoolArray,
        chains: Chains,
    ) -> None:
        self.fine, self.proxy, self.coarse_ends, self.boundary = fine, proxy, coarse_ends, boundary
        self.cost = crease_costs(fine.surface)
        # no path of a chain leaves its cells and those beside them, so other edges need not be looked at
        near = mask_of(len(boundary), np.r_[chains.vertex, chains.start, chains.end])
        close = spread(near, coarse_ends, max(STRAY_CELLS) + 1)
        member = np.append(close, False)[proxy.cell]
        close = member[fine.ends[0]] & member[fine.ends[1]]
        self.usable = np.flatnonzero(close & np.isfinite(self.cost))
        self.ends = fine.ends[0][self.usable], fine.ends[1][self.usable]
        # (coarse points,) fine vertex that stands for each of those near chains
        self.stand = self._representatives(chains, member, close)
        self.junctions = np.r_[chains.start, chains.end]

    def cut(self, chains: Chains, rings: int) -> Chains:
        """Cut paths along chains that stray so many cells from them; returns the chains that found none."""
        if len(chains.start) == 0:
            return chains
        owner, value = self._bands(chains, rings)
        owner[self.stand[self.junctions]] = -1
        owner[self.stand[np.r_[chains.start, chains.end]]] = -1
        jump = 1.0 if rings == 0 else 2.0
        start, end = self.stand[chains.start], self.stand[chains.end]
        where = Bands(self.ends, self.cost[self.usable], owner, value)
        routes = route(where, start, end, chains.size, jump)
        self.fine.cut[self.usable[routes.edges]] = True
        return _some_chains(chains, routes.failed)

    def find_way(self, ends: tuple[int, int]) -> bool:
        """Cut a shortest path between the stands of two coarse points, through any vertices that no seam uses:
        for the last few chains, one by one."""
        fine, (start, end) = self.fine, self.stand[list(ends)].tolist()
        if start < 0 or end < 0 or start == end:
            return False
        a, b = fine.ends
        free = ~fine.on_boundary
        free[a[fine.cut]] = free[b[fine.cut]] = False
        free[[start, end]] = True
        points = fine.surface.vertex_points
        reach = 6 * float(np.linalg.norm(points[start] - points[end]))
        # what is further away straight on is further along edges too
        free &= ((points - points[start]) ** 2).sum(1) <= (1 + 1e-9) * reach**2
        use = np.flatnonzero(np.isfinite(self.cost) & free[a] & free[b] & ~fine.cut)
        links = Graph(fine.n_vertices, a[use], b[use], self.cost[use])
        distance, before = links.paths(np.array([start]), reach)
        fine.cut[use[links.trace(before, np.array([end]))]] = True
        return bool(np.isfinite(distance[end]))

    def _bands(self, chains: Chains, rings: int) -> tuple[IntArray, FloatArray]:
        """Bands of chains on the fine surface: cells of their own, shares of the cells at their ends."""
        n, cell, fine = len(self.boundary), self.proxy.cell, self.fine
        owner, value = bands(self.coarse_ends, n, chains, self.boundary, rings)
        has = cell >= 0
        fine_owner = np.where(has, owner[cell], -1)
        fine_value = np.where(has, value[cell], 0.0)
        # a chain of one edge has no cell of its own: it begins where its two end cells meet
        short = np.flatnonzero(chains.size == 1)
        if len(short):
            key = edge_keys(chains.start[short], chains.end[short], n)
            here, there = (cell[end] for end in self.ends)
            meet = edge_keys(here, there, n)
            at = found_in(key, meet)
            hit = (at >= 0) & (here >= 0) & (there >= 0)
            for side in self.ends:
                vertex, chain = side[hit], short[at[hit]]
                free = fine_owner[vertex] < 0
                fine_owner[vertex[free]] = chain[free]
        closed = fine.on_boundary.copy()
        closed[fine.ends[0][fine.cut]] = closed[fine.ends[1][fine.cut]] = True
        at_end = mask_of(n, np.r_[chains.start, chains.end])
        return self._share_out(fine_owner, fine_value, has & at_end[cell], closed)

    def _share_out(
        self, owner: IntArray, value: FloatArray, junction: BoolArray, closed: BoolArray
    ) -> tuple[IntArray, FloatArray]:
        """Give the vertices of junction cells to the nearest chain; boundaries and ends of chains to none."""
        (a, b), cell = self.ends, self.proxy.cell
        owner = np.where(closed, -1, owner)
        fill = junction & ~closed & (owner < 0)
        # from a chain's own cells into a junction cell, but not on from there into another one
        use = (
            (fill[a] & fill[b] & (cell[a] == cell[b]))
            | (fill[a] & (owner[b] >= 0))
            | (fill[b] & (owner[a] >= 0))
        )
        a, b = a[use], b[use]
        seeds = np.unique(np.r_[a[~fill[a]], b[~fill[b]]])
        if len(seeds):
            links = undirected(len(owner), a, b, np.ones(len(a)))
            _, _, source = nearest(links, seeds)
            got = fill & (source >= 0)
            owner[got], value[got] = owner[source[got]], value[source[got]]
        return owner, value

    def _representatives(self, chains: Chains, member: BoolArray, close: BoolArray) -> IntArray:
        """(coarse points,) fine vertex that stands for each, −1 where none of its vertices is a ``member``.

        member: (fine vertices,) bool, those that may stand for a point; close: (e,) bool, edges between them.

        At a junction the vertex beside which the most chains begin; then one on the boundary where the coarse
        point is on it; then the nearest.
        """
        fine, cell, points = self.fine, self.proxy.cell, self.proxy.surface.points
        owner, _ = self._bands(chains, STRAY_CELLS[0])
        members = np.flatnonzero(member)
        ends = fine.ends[0][close], fine.ends[1][close]
        a, b = np.r_[ends[0], ends[1], members], np.r_[ends[1], ends[0], members]
        k = owner[b]
        here = (k >= 0) & (cell[a] >= 0)
        a, k = a[here], k[here]
        own = (chains.start[k] == cell[a]) | (chains.end[k] == cell[a])
        pairs = np.unique(a[own] * (len(chains.start) + 1) + k[own])
        beside = np.bincount(pairs // (len(chains.start) + 1), minlength=len(cell))
        c = cell[members]
        distance = np.linalg.norm(fine.surface.vertex_points[members] - points[c], axis=1)
        inside = self.boundary[c] & ~fine.on_boundary[members]
        first = first_of_groups(c, inside, -beside[members], distance)
        out = np.full(len(points), -1)
        out[c[first]] = members[first]
        return out


def _some_chains(chains: Chains, which: IntArray) -> Chains:
    """Some chains, numbered anew."""
    number = positions_in(len(chains.start), which)
    inner = number[chains.chain] >= 0
    return Chains(
        chains.start[which],
        chains.end[which],
        chains.vertex[inner],
        number[chains.chain[inner]],
        chains.position[inner],
        chains.size[which],
    )


def _joined(first: Chains, second: Chains) -> Chains:
    """Chains of both, those of the second behind those of the first."""
    if len(second.start) == 0:
        return first
    number = second.chain + len(first.start)
    parts = zip(
        dataclasses.astuple(first),
        (second.start, second.end, second.vertex, number, second.position, second.size),
        strict=True,
    )
    return Chains(*(np.r_[a, b] for a, b in parts))
