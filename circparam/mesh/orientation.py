"""The orientation of faces, chosen so that neighbours agree."""

from typing import NamedTuple

import numpy as np

from circparam.core.arrays import edge_keys, first_of_each, found_in, mask_of, numbered
from circparam.core.graph import breadth_first, components
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.halfedge import Pairs

FLAT_COSINE = np.cos(np.radians(0.5))  # of the angle between faces of one flat


class Orientation(NamedTuple):
    """Windings of faces: reversed_faces (m,) to reverse, keep (e,) pairs whose faces then agree, and the number
    of one-sided components (cut where keep is False)."""

    reversed_faces: BoolArray
    keep: BoolArray
    one_sided: int


def orient(normals: FloatArray, pairs: Pairs) -> Orientation:
    """Wind faces consistently across the pairs; components keep the winding of the larger part of their area.

    normals: (m, 3) of the faces as they are wound, as long as the faces are large. Components come from the
    double cover (every face twice, once for each side). A component has one side only if both copies of a face
    are connected. A one-sided component is wound along a breadth-first tree over whole polygons and flats.
    Pairs that still disagree are dropped, so no such cut crosses a flat in vain.
    """
    n_faces, areas = len(normals), np.linalg.norm(normals, axis=1)
    i, j = pairs.edges[:, 0] // 3, pairs.edges[:, 1] // 3
    keep = np.ones(len(i), bool)
    component, backwards, two_sided = double_cover(n_faces, i, j, pairs.against)
    one_sided = int(component.max()) + 1 - int(np.count_nonzero(two_sided))
    if one_sided:
        faces = ~two_sided[component]
        local = np.cumsum(faces) - 1
        e = faces[i]
        # as wound alike, the faces of a flat have one normal
        along = (normals[i] * normals[j]).sum(1) * np.where(pairs.against, -1, 1)
        whole = pairs.locked | (along > FLAT_COSINE * areas[i] * areas[j])
        backwards[faces] = _along_tree(
            int(faces.sum()), local[i[e]], local[j[e]], pairs.against[e], pairs.locked[e], whole[e]
        )
        keep = pairs.against == (backwards[i] ^ backwards[j])
    balance = np.bincount(component, np.where(backwards, -areas, areas))
    return Orientation(backwards ^ (balance < 0)[component], keep, one_sided)


def double_cover(
    n: int, i: IntArray, j: IntArray, flip: BoolArray
) -> tuple[IntArray, BoolArray, BoolArray]:
    """Signs of nodes such that signs differ across the pairs (i, j) exactly where ``flip`` is set.

    Returns ((n,) component, (n,) bool sign, (components,) bool whether such signs exist). The first node of
    every component has sign False.
    """
    if not flip.any():
        count, component = components(n, i, j)
        return component, np.zeros(n, bool), np.ones(count, bool)
    _, cover = components(
        2 * n, np.r_[i, i + n], np.r_[np.where(flip, j + n, j), np.where(flip, j, j + n)]
    )
    here, there = cover[:n], cover[n:]
    label, component = numbered(np.minimum(here, there))
    two_sided = ~mask_of(len(label), component[here == there])
    sign = here > there
    first = first_of_each(component, len(label))
    return component, sign ^ sign[first][component], two_sided


def _along_tree(
    n: int, i: IntArray, j: IntArray, flip: BoolArray, locked: BoolArray, whole: BoolArray
) -> BoolArray:
    """Signs along a breadth-first tree whose nodes are whole polygons (faces joined by locked pairs) and flats
    (joined by ``whole`` ones).

    Inside one-sided parts, first a flat, then a polygon, edges are like all others.
    """
    for fixed in (locked, np.zeros_like(locked)):
        node, inside, two_sided = double_cover(n, i[whole], j[whole], flip[whole])
        if two_sided.all():
            break
        whole = whole & (fixed | two_sided[node[i]])
    else:
        node, inside, _ = double_cover(n, i[whole], j[whole], flip[whole])
    count = int(node.max()) + 1
    a, b = node[i], node[j]
    step = flip ^ inside[i] ^ inside[j]
    across = a != b
    a, b, step = a[across], b[across], step[across]
    _, _, parent = breadth_first(count, a, b)
    child = np.flatnonzero(parent < count)
    up = parent[child]
    edge = found_in(edge_keys(a, b, count), edge_keys(child, up, count))
    _, sign, _ = double_cover(count, a[edge], b[edge], step[edge])
    return sign[node] ^ inside
