"""Seams as chains of vertices between junctions, and shortest paths for all of them in one search."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    first_of_groups,
    first_of_runs,
    mask_of,
    positions_in,
    ranges,
    sorted_distinct,
    stable_order,
)
from circparam.core.graph import components, distances, nearest, undirected
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Chains:
    """Chains of seam edges between junctions.

    start, end: (k,) vertices. vertex, chain, position: (i,) the vertices between the ends, their chain and how
    many edges after the start they stand. size: (k,) edges of each chain.
    """

    start: IntArray
    end: IntArray
    vertex: IntArray
    chain: IntArray
    position: IntArray
    size: IntArray


def chains_of(a: IntArray, b: IntArray, n: int, stop: BoolArray) -> Chains:
    """Order seam edges (a, b) into chains that end where ``stop`` is set or the valence is not 2.

    Closed chains are opened at their lowest vertex, and what then ends where it began is halved, so that every
    chain runs between two different vertices.
    """
    stop = stop | (np.bincount(np.r_[a, b], minlength=n) != 2)
    for _ in range(3):
        chains, closed, middle = _chain_once(a, b, n, stop)
        if len(closed) == 0 and len(middle) == 0:
            break
        stop = stop.copy()
        stop[closed] = True
        stop[middle] = True
    return chains


def _chain_once(
    a: IntArray, b: IntArray, n: int, stop: BoolArray
) -> tuple[Chains, IntArray, IntArray]:
    """Chains as they are, the lowest vertex of closed ones, the middle of those that end where they begin."""
    k = np.arange(len(a))
    # a junction is a node of its own for every edge end, so chains are components
    node_a = np.where(stop[a], n + 2 * k, a)
    node_b = np.where(stop[b], n + 2 * k + 1, b)
    total = n + 2 * len(a)
    graph = undirected(total, node_a, node_b, np.ones(len(a)))
    _, label = components(total, node_a, node_b)
    vertex_of = np.r_[np.arange(n), np.stack([a, b], 1).ravel()]
    nodes = sorted_distinct(np.r_[node_a, node_b])
    order = nodes[stable_order(label[nodes])]
    runs = first_of_runs(label[order])
    low, high = order[runs], order[np.r_[runs[1:], len(order)] - 1]
    opened = high >= n  # a closed chain has no junction node
    closed = low[~opened]
    # ascending node numbers: junction nodes come last in each run, exactly two for an open chain
    position_of_high = np.r_[runs[1:], len(order)] - 1
    first_end = order[position_of_high[opened] - 1]
    last_end = high[opened]
    if len(first_end) == 0:
        none = np.zeros(0, np.int64)
        return Chains(none, none, none, none, none, none), closed, none
    steps = distances(graph, first_end)
    chain_of_label = positions_in(int(label.max()) + 1, label[first_end])
    inner = nodes[(nodes < n) & (chain_of_label[label[nodes]] >= 0)]
    chain = chain_of_label[label[inner]]
    size = steps[last_end].astype(np.int64)
    start, end = vertex_of[first_end], vertex_of[last_end]
    position = steps[inner].astype(np.int64)
    same = (start == end)[chain] & (position == (size // 2)[chain])
    chains = Chains(start, end, inner, chain, position, size)
    return chains, closed, inner[same]


def spread(near: BoolArray, ends: tuple[IntArray, IntArray], rings: int) -> BoolArray:
    """(n,) bool: vertices at most so many edges (their two ends) from those that are ``near``."""
    for _ in range(rings):
        ahead, back = ends[1][near[ends[0]]], ends[0][near[ends[1]]]
        near = near | mask_of(len(near), np.r_[ahead, back])
    return near


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
    # no path is longer than ``rings`` edges, so the others need not be sorted
    near = spread(mask_of(n, chains.vertex), ends, rings) & ~blocked
    open_edge = near[ends[0]] & near[ends[1]]
    a, b = ends[0][open_edge], ends[1][open_edge]
    if len(chains.vertex) and len(a):
        _, _, source = nearest(undirected(n, a, b, np.ones(len(a))), chains.vertex, rings)
        reached = (source >= 0) & ~blocked
        owner[reached] = owner[source[reached]]
        value[reached] = value[source[reached]]
    return owner, value


@dataclass(frozen=True, eq=False)
class Routes:
    """Edges on the paths found, the chain of each, and the chains that found none."""

    edges: IntArray
    chain: IntArray
    failed: IntArray


@dataclass(frozen=True, eq=False)
class Bands:
    """Where paths may run: disjoint bands of vertices, one a chain.

    ends: (e,), (e,) vertices of the edges that may be used. weight: (e,) lengths. owner: (vertices,) chain,
    or −1.
    value: (vertices,) position along the chain, from 0 to its size.
    """

    ends: tuple[IntArray, IntArray]
    weight: FloatArray
    owner: IntArray
    value: FloatArray


def route(
    bands: Bands, start: IntArray, end: IntArray, size: IntArray, jump: float = 2.0
) -> Routes:
    """Shortest paths from start[k] to end[k], each through the band of chain k: one search for all.

    size: (k,) steps of each chain: no step of a path goes further than ``jump`` along it, so that a path does
    not skip to another part of a seam that runs beside itself. The bands are disjoint, so paths never cross.
    """
    ends, weight, owner, value = bands.ends, bands.weight, bands.owner, bands.value
    n, k = len(owner), len(start)
    on = owner >= 0
    on[start] = on[end] = True
    used = np.flatnonzero(on[ends[0]] & on[ends[1]])
    a, b = ends[0][used], ends[1][used]
    a, b = np.r_[a, b], np.r_[b, a]
    edge = np.r_[used, used]
    w = weight[edge]
    both = (owner[a] >= 0) & (owner[a] == owner[b]) & (np.abs(value[a] - value[b]) <= jump)
    parts = [(a[both], b[both], edge[both], w[both])]
    chain = np.where(owner[a] >= 0, owner[a], 0)
    for node, at, place in ((n + np.arange(k), start, 0 * size), (n + k + np.arange(k), end, size)):
        touch = (owner[a] >= 0) & (at[chain] == b) & (np.abs(value[a] - place[chain]) <= jump)
        joint = node[chain[touch]]
        parts += [
            (a[touch], joint, edge[touch], w[touch]),
            (joint, a[touch], edge[touch], w[touch]),
        ]
    # edges that join the two ends of a chain at once, each for one chain
    step, chain = _direct(a, b, start, end)
    alone = first_of_groups(edge[step])
    step, chain = step[alone], chain[alone]
    parts.append((n + chain, n + k + chain, edge[step], w[step]))
    r, c, i, x = (np.concatenate(column) for column in zip(*parts, strict=True))
    total = n + 2 * k
    order = np.lexsort((i, x, c, r))
    r, c, i, x = r[order], c[order], i[order], x[order]
    keep = first_of_runs(r * total + c)
    r, c, i, x = r[keep], c[keep], i[keep], x[keep]
    graph = sps.csr_matrix((x, (r, c)), shape=(total, total))
    distance, before, _ = nearest(graph, n + np.arange(k))
    found = np.isfinite(distance[n + k + np.arange(k)])
    key = r * total + c
    walker = np.flatnonzero(found)
    here = n + k + walker
    walked, whose = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    while len(here):
        previous = before[here]
        walked.append(i[np.searchsorted(key, previous * total + here)])
        whose.append(walker)
        going = (previous < n) | (previous >= n + k)
        here, walker = previous[going], walker[going]
    return Routes(np.concatenate(walked), np.concatenate(whose), np.flatnonzero(~found))


def _direct(a: IntArray, b: IntArray, start: IntArray, end: IntArray) -> tuple[IntArray, IntArray]:
    """Steps a[i] → b[i] that join the two ends of a chain at once: (their numbers, the chains)."""
    size = 1 + max(int(ends.max(initial=0)) for ends in (a, b, start, end))
    sought = start * size + end
    order = np.argsort(sought, kind="stable")
    key = a * size + b
    low = np.searchsorted(sought[order], key, side="left")
    high = np.searchsorted(sought[order], key, side="right")
    hit = np.flatnonzero(high > low)
    count = (high - low)[hit]
    step = np.repeat(hit, count)
    return step, order[low[step] + ranges(count)]
