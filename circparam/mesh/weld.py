"""Coincident vertices, degenerate and duplicate faces, found as maps: nothing is edited."""

import numpy as np

from circparam.core.arrays import (
    dot3,
    doubled_areas,
    first_of_each,
    mask_of,
    numbered,
    numbered_rows,
    sorted_distinct,
)
from circparam.core.compiled import kd_tree
from circparam.core.graph import components
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.mesh import Mesh

DEGENERATE_AREA_SHARE = 1e-12  # a face with area <= this x longest edge² is degenerate
# also one whose edges are this much shorter than the longest: its squares underflow
TINY_EDGE_SHARE = 1e-50
# more pairs within the weld tolerance than this a vertex: the tolerance is absurd
MAX_PAIRS_PER_VERTEX = 64


def weld_map(mesh: Mesh, eps: float = 0.0) -> IntArray:
    """(n,) vertex → the lowest vertex at its position, or joined to it by steps of at most ``eps``.

    eps is in units of the mesh. Raises OptionError if it is negative or not finite, or so large that
    whole neighbourhoods would fall together.
    """
    if not (np.isfinite(eps) and eps >= 0):
        raise OptionError(f"the weld tolerance must be a distance of at least 0, not {eps}")
    weld = mesh.weld
    if eps == 0:
        return weld
    used = mask_of(len(weld), mesh.faces)
    points = sorted_distinct(weld[used])
    scale = mesh_scale(mesh)
    tree = kd_tree(mesh.points[points] * scale)
    radius = eps * scale
    if tree.count_neighbors(tree, radius) > (2 * MAX_PAIRS_PER_VERTEX + 1) * len(points):
        raise OptionError(
            f"the weld tolerance {eps:g} joins whole neighbourhoods of vertices: give a smaller one"
        )
    near = tree.query_pairs(radius, output_type="ndarray").astype(np.int64)
    count, labels = components(len(points), near[:, 0], near[:, 1])
    target = np.arange(len(weld))
    target[points] = points[first_of_each(labels, count)][labels]
    return target[weld]


def degenerate_faces(points: FloatArray, faces: IntArray) -> BoolArray:
    """(m,) bool: a repeated point, or an area <= 1e-12 x longest edge².

    points: (n, 3), scaled as ``mesh_scale`` has it. Also faces 1e50 times smaller than the largest, whose
    squares underflow in float64.
    """
    p = points[faces]
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    span = np.abs([*e1.T, *e2.T]).max(0)
    area = 0.5 * doubled_areas(e1, e2)
    longest = np.max([dot3(e, e) for e in (e1, e2, e2 - e1)], 0)
    tiny = span <= TINY_EDGE_SHARE * span.max(initial=0.0)
    a, b, c = faces.T
    return (area <= DEGENERATE_AREA_SHARE * longest) | tiny | (a == b) | (b == c) | (c == a)


def first_duplicates(faces: IntArray, n_points: int) -> IntArray:
    """(m,) the first face with the same three points, in any order and winding (itself where it is that)."""
    rows = np.sort(faces, 1)
    pair = rows[:, 0] * n_points + rows[:, 1]
    if n_points >= 2**21:  # all three in one number would overflow
        pair = numbered(pair)[1]
    head, label = numbered(pair * n_points + rows[:, 2])
    return first_of_each(label, len(head))[label]


def first_in_place(welded: IntArray, first: IntArray, uv: FloatArray) -> IntArray:
    """(m,) the first face with the same three points and the same uv (m, 3, 2) at each of them.

    first: (m,) the first face with the same three points. NaN is no place: a face with it is its own.
    """
    out = np.arange(len(first))
    twin = mask_of(len(first), first[first != out])
    face = np.flatnonzero(twin[first] & np.isfinite(uv).all((1, 2)))
    order = np.argsort(welded[face], axis=1, kind="stable")
    place = np.take_along_axis(uv[face], order[..., None], 1).reshape(-1, 6)
    start, label = numbered_rows(np.c_[place, first[face]])
    out[face] = face[start[label]]
    return out


def mesh_scale(mesh: Mesh) -> float:
    """A power of two that brings the mesh to a size of about 1 if its own is outside 2^±50, else 1."""
    used = mesh.points[sorted_distinct(mesh.faces)]
    span = float((used.max(0) / 2 - used.min(0) / 2).max())
    if span == 0:
        return 1.0
    exponent = int(np.frexp(span)[1])
    return (
        1.0 if abs(exponent) <= 50 else float(np.ldexp(1.0, int(np.clip(-exponent, -1000, 1000))))
    )
