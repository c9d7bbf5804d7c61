"""Components that are copies of each other: seams are decided on one of them and hold for all."""

import numpy as np

from circparam.core.arrays import group_count, mask_of, ranges
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.hard.regions import FLAT, NOISE, extent, turns
from circparam.seams.moves.glue import hashed

# of the extent of all: sides of copies differ by what noise does to their four ends
SIDES = 2 * 2 * NOISE


@dataclass(frozen=True, eq=False)
class Copies:
    """original: (m,) face that each face is a copy of, itself where it is none. edge: (e,) likewise."""

    original: IntArray
    edge: IntArray

    @property
    def first(self) -> BoolArray:
        """(m,) bool, faces that are copies of no other."""
        return self.original == np.arange(len(self.original))


def find_copies(surface: Surface) -> Copies:
    """Components with the same faces in the same order, of the same shape, joined and locked alike.

    Each is a copy of the first of those with equal hashes, where its corners and angles agree with that one's.
    """
    e, (n, component) = surface.edges, surface.components
    of_edge = component[surface.sides[0]]
    size, edges = group_count(component, n), group_count(of_edge, n)
    rank = _ranks(component, size)
    half = 3 * rank[e // 3] + e % 3
    mark = hashed(half[:, 0] * 3 + surface.locked, half[:, 1])
    total = np.zeros(n, np.uint64)
    np.add.at(total, of_edge, mark)
    key = hashed(size, edges) ^ total
    _, lead, group = np.unique(key, return_index=True, return_inverse=True)
    lead = lead[group.reshape(-1)]
    original, edge = _counterparts(component, size, lead), _counterparts(of_edge, edges, lead)
    # equal hashes are no proof, nor do they see the shape
    side = np.linalg.norm(surface.rest_triangles[:, [1, 2, 0]] - surface.rest_triangles, axis=2)
    differs = np.abs(side - side[original]).max(1) > SIDES * extent(surface)
    angle, concave = turns(surface)
    signed = np.where(concave, -angle, angle)
    wrong = (half != half[edge]).any(1) | (np.abs(signed - signed[edge]) > 2 * FLAT)
    wrong |= surface.locked != surface.locked[edge]
    other = mask_of(n, np.r_[component[differs], of_edge[wrong]])
    return Copies(
        np.where(other[component], np.arange(len(rank)), original),
        np.where(other[of_edge], np.arange(len(e)), edge),
    )


def _ranks(label: IntArray, size: IntArray) -> IntArray:
    """(k,) place of each member in its group. label: (k,) group of each, size: (n,) of the groups."""
    out = np.empty(len(label), np.int64)
    out[np.argsort(label, kind="stable")] = ranges(size)
    return out


def _counterparts(label: IntArray, size: IntArray, lead: IntArray) -> IntArray:
    """(k,) the member in the same place of the group that leads each group. lead: (n,) groups."""
    order, start = np.argsort(label, kind="stable"), np.cumsum(size) - size
    return order[start[lead[label]] + _ranks(label, size)]


def spread_copies(surface: Surface, copies: Copies, part: Atlas) -> Atlas:
    """The atlas of all from that of the faces that are copies of no other."""
    whole = Atlas(surface, np.zeros(len(surface.edges), bool))
    whole.put(copies.first, part)
    whole.cut = whole.cut[copies.edge]
    whole.corners = whole.corners[copies.original]
    return whole
