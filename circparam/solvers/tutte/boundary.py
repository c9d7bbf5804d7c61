"""BOUNDARIES: positions of the outer boundary of every chart, before the inside is solved.

A boundary is one function of the cut mesh and the options. It returns the cut mesh to solve, the fixed vertices
and their places, all charts at once. Every chart's boundary is centred on the origin and encloses the area of
the chart; charts overlap, because packing is a later stage. Only ``virtual`` adds faces to the cut mesh. Convex
polygons have a vertex at each corner, and sides that bend where a face would collapse.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import cross2, ends_of, positions_in
from circparam.core.registry import Row, Table
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.tutte.outer import FixedBoundary, OuterBoundary, TutteOptions, outer_boundary

BoundaryFunction: TypeAlias = Callable[[CutMesh, TutteOptions], FixedBoundary]
# Width of the ring of virtual faces, as a share of the radius of a circle with the perimeter of the chart.
RING_WIDTH_RADII = 0.5
# Largest turn, in radians, of the arc that stands in for a straight side with chords.
BULGE_RADIANS = 0.2


def on_square(cut_mesh: CutMesh, options: TutteOptions) -> FixedBoundary:
    """A square with the area of the chart, a boundary vertex at each corner where there are four."""
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return _on_polygon(cut_mesh, outer_boundary(cut_mesh, options.spacing), corners)


def on_polygon(cut_mesh: CutMesh, options: TutteOptions) -> FixedBoundary:
    """The convex polygon of the options, scaled to the area of the chart.

    Raises OptionError if there is none, or it is not convex.
    """
    if options.polygon is None:
        raise OptionError("the boundary 'polygon' needs its corners: --boundary polygon FILE")
    corners = check_polygon(options.polygon)
    return _on_polygon(cut_mesh, outer_boundary(cut_mesh, options.spacing), corners)


def _circle_of(outer: OuterBoundary, areas: FloatArray) -> FloatArray:
    """(b, 2) places on circles with these areas (n_charts,) round the origin."""
    angle = 2 * np.pi * outer.place
    radius = np.sqrt(areas / np.pi)[outer.chart]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)


def on_circle(cut_mesh: CutMesh, options: TutteOptions) -> FixedBoundary:
    """A circle with the area of the chart: strictly convex everywhere (Tutte 1963)."""
    outer = outer_boundary(cut_mesh, options.spacing)
    return FixedBoundary(cut_mesh, outer.vertices, _circle_of(outer, cut_mesh.chart_areas))


def behind_virtual_faces(cut_mesh: CutMesh, options: TutteOptions) -> FixedBoundary:
    """Virtual faces round the boundary, only their outer vertices fixed on a circle (Lee, Kim, Lee 2002).

    The real boundary is free to move; the whole is still a convex map: nothing flips.
    """
    outer = outer_boundary(cut_mesh, options.spacing)
    extended, fixed = _with_virtual_faces(cut_mesh, outer)
    return FixedBoundary(
        extended, fixed, _circle_of(outer, cut_mesh.chart_areas * (1 + RING_WIDTH_RADII) ** 2)
    )


def _with_virtual_faces(cut_mesh: CutMesh, outer: OuterBoundary) -> tuple[CutMesh, IntArray]:
    """(cut mesh with two virtual faces outside every boundary edge, after the real ones; (b,) outer vertices).

    Each edge carries an isosceles trapezoid, as if the boundary were a circle with the flat ring around it.
    """
    b = len(outer.vertices)
    base, follower = outer.length, outer.follower
    height = RING_WIDTH_RADII * (outer.sums(base) / (2 * np.pi))[outer.index]
    top = base * (1 + RING_WIDTH_RADII)
    i, j = outer.vertices, outer.vertices[follower]
    outside = cut_mesh.n_vertices + np.arange(b)
    # lower face: j, i, outside of i; upper face: j, outside of i, outside of j
    p = np.zeros((b, 4, 2))  # j, i, outside of i, outside of j, seen with the surface below
    p[:, 1, 0] = base
    p[:, 2, 0] = (base + top) / 2
    p[:, 3, 0] = (base - top) / 2
    p[:, 2:, 1] = height[:, None]
    faces = np.concatenate(
        [np.stack([j, i, outside], 1), np.stack([j, outside, outside[follower]], 1)]
    )
    lower = 3 * (len(cut_mesh.faces) + np.arange(b))
    upper = lower + 3 * b
    edges = np.concatenate(
        [
            cut_mesh.edges,
            np.stack([outer.half_edge, lower], 1),
            np.stack([lower + 2, upper], 1),
            # the side i → outside of i of an edge meets the side outside of j → j of the edge before it
            np.stack([lower + 1, upper[np.argsort(follower)] + 2], 1),
        ]
    )
    extended = CutMesh(
        np.concatenate([cut_mesh.faces, faces]),
        np.concatenate([cut_mesh.rest_triangles, p[:, :3], p[:, [0, 2, 3]]]),
        np.concatenate([cut_mesh.chart, outer.chart, outer.chart]),
        edges,
    )
    return extended, outside


_CONVEX = frozenset({"convex-boundary"})


BOUNDARIES: Table[BoundaryFunction] = Table(
    "border",
    Row("circle", on_circle, "a circle with the area of the chart", "Tutte 1963", _CONVEX),
    Row("square", on_square, "a square with the area of the chart", "Tutte 1963", _CONVEX),
    Row("polygon", on_polygon, "a convex polygon of your own", "Tutte 1963", _CONVEX),
    Row(
        "virtual",
        behind_virtual_faces,
        "a circle round a ring of virtual faces: the real boundary moves freely",
        "Lee, Kim and Lee 2002",
        frozenset({"free-boundary"}),
    ),
)


def check_polygon(given: object) -> FloatArray:
    """(k, 2) corners, counter-clockwise; raises OptionError unless they form a strictly convex polygon."""
    try:
        corners = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise OptionError("a polygon needs 3 or more corners (x, y) that are numbers") from None
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise OptionError(f"a polygon needs 3 or more corners (x, y), not shape {corners.shape}")
    if not np.isfinite(corners).all():
        raise OptionError("the polygon has a corner that is not finite")
    corners = corners - corners.mean(0)
    side = np.roll(corners, -1, 0) - corners
    if cross2(corners, np.roll(corners, -1, 0)).sum() < 0:
        return check_polygon(corners[::-1])
    turn = cross2(side, np.roll(side, -1, 0))
    length = np.hypot(side[:, 0], side[:, 1])
    sine = turn / np.maximum(length * np.roll(length, -1), 1e-300)
    winding = np.arctan2(turn, (side * np.roll(side, -1, 0)).sum(1)).sum()
    if (sine < 1e-9).any() or not np.isclose(winding, 2 * np.pi):
        bad = (int(np.argmin(sine)) + 1) % len(corners)
        raise OptionError(
            f"the polygon is not strictly convex at its corner {bad}: move or drop it"
        )
    return corners


def _on_polygon(cut_mesh: CutMesh, outer: OuterBoundary, corners: FloatArray) -> FixedBoundary:
    """Place boundaries on a polygon, a vertex at each corner; bend the sides whose faces would collapse."""
    k = len(corners)
    side = np.roll(corners, -1, 0) - corners
    length = np.hypot(side[:, 0], side[:, 1])
    target = np.r_[0.0, np.cumsum(length)] / length.sum()
    at = _corner_entries(outer, target[:k])
    # the side of every vertex, and how far along it
    start = outer.start
    local = np.arange(len(outer.vertices)) - start[outer.index]
    of = (local[:, None] >= at[outer.index]).sum(1) - 1
    fits = outer.size >= k
    free = ~fits[outer.index]  # fewer vertices than corners: simply along the perimeter
    of[free] = np.searchsorted(target, outer.place[free], side="right") - 1
    of = np.clip(of, 0, k - 1)
    begin = np.where(free, target[of], outer.place[start[outer.index] + at[outer.index, of]])
    after = np.append(at, outer.size[:, None], axis=1)[outer.index, of + 1]
    last = after >= outer.size[outer.index]
    after_place = outer.place[start[outer.index] + np.where(last, 0, after)]
    end = np.where(free, target[of + 1], np.where(last, 1.0, after_place))
    t = np.clip((outer.place - begin) / np.maximum(end - begin, 1e-300), 0, 1)
    bent = _sides_with_chords(cut_mesh, outer, of, t, k)
    exterior = np.arctan2(cross2(np.roll(side, 1, 0), side), (np.roll(side, 1, 0) * side).sum(1))
    turn = np.minimum(BULGE_RADIANS, np.minimum(exterior, np.roll(exterior, -1)) / 3)[of]
    turn = np.where(bent[outer.index, of], turn, 0.0)
    along, out = _arc(t, turn)
    normal = np.stack([side[:, 1], -side[:, 0]], 1)
    uv = corners[of] + along[:, None] * side[of] + out[:, None] * normal[of]
    area = cross2(corners, np.roll(corners, -1, 0)).sum() / 2
    uv *= np.sqrt(cut_mesh.chart_areas / area)[outer.chart][:, None]
    return FixedBoundary(cut_mesh, outer.vertices, uv)


def _arc(t: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A point at share t of the arc over the unit segment that leaves it at angle ``turn``: (along, out)."""
    flat = turn <= 0
    a = np.where(flat, 1.0, turn)
    angle = a * (2 * t - 1)
    along = 0.5 + np.sin(angle) / (2 * np.sin(a))
    out = (np.cos(angle) - np.cos(a)) / (2 * np.sin(a))
    return np.where(flat, t, along), np.where(flat, 0.0, out)


def _corner_entries(outer: OuterBoundary, target: FloatArray) -> IntArray:
    """(n, k) entry within its boundary of the vertex that takes each corner: the nearest, all different."""
    n, k = len(outer.size), len(target)
    key = 2.0 * outer.index + outer.place
    goal = 2.0 * np.arange(n)[:, None] + target
    right = np.searchsorted(key, goal)
    right = np.clip(right, outer.start[:, None], (outer.start + outer.size - 1)[:, None])
    left = np.maximum(right - 1, outer.start[:, None])
    nearer = np.abs(key[left] - goal) <= np.abs(key[right] - goal)
    at = np.where(nearer, left, right) - outer.start[:, None]
    step = np.arange(k)
    at = np.maximum.accumulate(at - step, axis=1) + step
    at[:, 0] = 0
    result: IntArray = np.minimum(at, np.maximum(outer.size[:, None] - k, 0) + step)
    return np.minimum(result, outer.size[:, None] - 1)


def _sides_with_chords(
    cut_mesh: CutMesh, outer: OuterBoundary, of: IntArray, t: FloatArray, k: int
) -> BoolArray:
    """(n, k): an inner edge joins two boundary vertices on this side (its corners included)."""
    n = len(outer.size)
    side = np.full(cut_mesh.n_vertices, -1)
    side[outer.vertices] = of
    corner = np.zeros(cut_mesh.n_vertices, bool)
    corner[outer.vertices] = t == 0
    i, j = ends_of(cut_mesh.faces, cut_mesh.edges[:, 0])
    on = (side[i] >= 0) & (side[j] >= 0)
    i, j = i[on], j[on]
    index = positions_in(cut_mesh.n_charts, outer.chart[outer.start])
    chart = index[cut_mesh.vertex_chart[i]]
    out = np.zeros((n, k), bool)
    # a corner vertex (t = 0) belongs to its own side and to the one before it
    for a, b in ((0, 0), (1, 0), (0, 1), (1, 1)):
        si = (side[i] - a) % k
        sj = (side[j] - b) % k
        ok = (si == sj) & (corner[i] | (a == 0)) & (corner[j] | (b == 0))
        out[chart[ok], si[ok]] = True
    return out
