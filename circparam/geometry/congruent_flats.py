"""Flats of components: copies whose triangles run another way across their flats."""

from typing import NamedTuple

import numpy as np

from circparam.core.arrays import (
    found_in,
    group_count,
    group_max,
    group_sum,
    next_half_edge,
    normals_of,
    numbered,
    positions_in,
    scattered,
    sorted_distinct,
    unit,
)
from circparam.core.graph import components
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.halfedge import boundary_half_edges, sort_by_edge


@dataclass(frozen=True, eq=False)
class Flats:
    """label: (m,) flat of each face, from 0 on. rim: (h,) half-edges between two flats, or of one face."""

    label: IntArray
    rim: IntArray


def find_flats(points: FloatArray, vertex: IntArray, slack: FloatArray, kind: IntArray) -> Flats:
    """Faces that lie in one plane and hang together.

    points: (v, 3). vertex: (m, 3). slack: (m,) how far from a plane the points of a face may lie. kind: (m,)
    label that the faces of a flat share. A face in no larger flat is one.
    """
    m, flat = len(vertex), vertex.ravel()
    pairs = sort_by_edge(vertex, len(points)).pairs
    i, j = pairs.T
    corner = points[vertex]
    cross = normals_of(corner)
    normal = unit(cross)
    f, g = i // 3, j // 3
    away = points[flat[next_half_edge(next_half_edge(j))]] - points[flat[j]]
    back = points[flat[next_half_edge(next_half_edge(i))]] - points[flat[i]]
    level = np.abs((away * normal[f]).sum(1)) <= slack[f]
    level &= np.abs((back * normal[g]).sum(1)) <= slack[g]
    level &= ((normal[f] * normal[g]).sum(1) > 0) & (kind[f] == kind[g])
    level &= flat[i] == flat[next_half_edge(j)]
    n, label = components(m, f[level], g[level])
    # finely bent surfaces are level from face to face and no flats
    mean = unit(group_sum(cross, label, n))
    height = (corner * mean[label][:, None]).sum(2)
    spread = group_max(height.max(1), label, n) + group_max(-height.min(1), label, n)
    bent = (spread > 2 * group_max(slack, label, n))[label]
    label = numbered(np.where(bent, n + np.arange(m), label))[1]
    return Flats(label, boundary_half_edges(m, pairs[label[f] == label[g]]))


class Copies(NamedTuple):
    """component: (c,) that are copies of their leaders. face: (k,) their faces; corner: (k, 3) of the leader,
    at the same vertex of the same face or flat; turned: (k,) bool, with the opposite winding. uneven: (u,)
    components of these with other triangles than their leader."""

    component: IntArray
    face: IntArray
    corner: IntArray
    turned: BoolArray
    uneven: IntArray

    @classmethod
    def joined(cls, some: "list[Copies]") -> "Copies":
        """Those of all of them."""
        return cls(*(np.concatenate(x) for x in zip(*some, strict=True)))


def same_flats(
    flats: Flats,
    vertex: IntArray,
    component: IntArray,
    kind: IntArray,
    pairs: tuple[IntArray, IntArray],
    match: IntArray,
    mirror: bool,
) -> Copies:
    """Components whose flats have the outlines of those of their leaders.

    vertex: (m, 3), component, kind: (m,). pairs: components (k,), each once, and their leaders (k,). match:
    vertex of the leader of each vertex of the components. mirror: outlines may run the other way round as well.
    """
    own, lead = pairs
    label, rim, flat = flats.label, flats.rim, vertex.ravel()
    count, n = len(own), int(vertex.max()) + 1
    number = positions_in(int(component.max()) + 1, own)
    mine = rim[number[component[rim // 3]] >= 0]
    which = number[component[mine // 3]]
    size = group_count(component[rim // 3], len(number))
    start, end = match[flat[mine]], match[flat[next_half_edge(mine)]]
    key = flat[rim] * n + flat[next_half_edge(rim)]
    good, turned = np.zeros(count, bool), np.zeros(count, bool)
    partner = np.zeros(len(mine), np.int64)
    for back in (False, True) if mirror else (False,):
        at = found_in(key, end * n + start if back else start * n + end)
        missed = group_count(which[at < 0], count) > 0
        different = sorted_distinct(which * len(rim) + np.maximum(at, 0)) // len(rim)
        twice = group_count(different, count) < group_count(which, count)
        fits = ~good & ~missed & ~twice & (size[own] == size[lead])
        good, turned = good | fits, turned | (fits & back)
        partner = np.where(fits[which], rim[at], partner)
    keep = good[which]
    good &= ~_astray(label, kind, mine[keep], partner[keep], which[keep], count)
    keep = good[which]
    to = scattered(int(label.max()) + 1, label[mine[keep] // 3], label[partner[keep] // 3])
    # for each corner of these components that of the same vertex and flat of the leader
    of = number[component]
    face = np.flatnonzero((of >= 0) & np.append(good, False)[of])
    asked = to[label[face]][:, None] * n + match[vertex[face]]
    at = found_in((label[:, None] * n + vertex).ravel(), asked)
    good[of[face[(at < 0).any(1)]]] = False
    keep = good[of[face]]
    return Copies(own[good], face[keep], at[keep], turned[of[face[keep]]], own[good])


def _astray(
    label: IntArray, kind: IntArray, mine: IntArray, partner: IntArray, which: IntArray, count: int
) -> BoolArray:
    """(count,) bool: groups with a flat on two flats, two flats on one, or one of another kind."""
    f, g = label[mine // 3], label[partner // 3]
    rows = np.unique(np.stack([which, f, g], 1), axis=0)
    out = np.zeros(count, bool)
    for column in (1, 2):
        pairs, many = np.unique(rows[:, [0, column]], axis=0, return_counts=True)
        out[pairs[many > 1, 0]] = True
    out[which[kind[mine // 3] != kind[partner // 3]]] = True
    return out
