"""Convex boundaries: where the outer boundary of every chart is laid before the inside is solved.

A boundary is one function of cut mesh and options. It returns the cut mesh to solve, the vertices it fixes and
their places, all charts at once; every chart's boundary is centred on the origin (charts overlap: packing is a
later stage) and encloses the area of the chart. Only ``virtual`` adds faces to the cut mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2, group_sum, next_half_edge
from circparam.core.registry import Row, Table
from circparam.errors import OptionError
from circparam.geometry.intrinsic import corner_angles
from circparam.mesh.cut_mesh import CutMesh

SPACINGS = ("arc-length", "uniform")

# Boundary edges shorter than this share of their mean are spaced as if they were so long: on a circle the
# triangle of an arc δ has area δ³/16, which must stay far above the rounding of the coordinates.
SHORTEST = 1e-3

# Largest turn, in radians, of the arc that stands in for a straight side with chords.
BULGE = 0.2


@dataclass(frozen=True)
class TutteOptions:
    """How a chart is embedded: its boundary, and what is done where weights or numbers fail.

    boundary: row of BORDERS. spacing: ``arc-length`` (as far apart as on the surface) or ``uniform``. polygon:
    (k, 2) corners of a convex polygon, either way round, for the boundary ``polygon``; None otherwise. clamp:
    lift negative weights to small positive ones. repair: untangle what double precision flips (see ``embed``).
    """

    boundary: str = "circle"
    spacing: str = "arc-length"
    polygon: FloatArray | None = None
    clamp: bool = False
    repair: bool = True


@dataclass(frozen=True, eq=False)
class Ring:
    """Outer boundaries of all charts, in order: vertices (b,), their chart (b,), the half-edge (b,) that leaves
    each, and place (b,): its parameter along the boundary, from 0 at the start of the loop to below 1.
    """

    vertices: IntArray
    chart: IntArray
    half_edge: IntArray
    place: FloatArray
    size: IntArray

    @property
    def start(self) -> IntArray:
        """(n,) first entry of each chart."""
        return np.cumsum(self.size) - self.size

    @property
    def index(self) -> IntArray:
        """(b,) chart of each entry, counted among the charts that have a ring."""
        return np.repeat(np.arange(len(self.size)), self.size)


@dataclass(frozen=True, eq=False)
class BoundarySegments:
    """cut mesh: those to solve, real faces and vertices first. vertices (b,): the fixed ones, in order along
    each chart's boundary. uv (b, 2): their places, in units of the mesh.
    """

    cut_mesh: CutMesh
    vertices: IntArray
    uv: FloatArray


BoundaryFunction: TypeAlias = Callable[[CutMesh, TutteOptions], BoundarySegments]


def outer_ring(cut_mesh: CutMesh, spacing: str = "arc-length") -> Ring:
    """The outer boundary of every chart, charts in ascending order, begun at its sharpest corner.

    Raises OptionError for an unknown spacing. Every chart must have a boundary.
    """
    if spacing not in SPACINGS:
        raise OptionError(f"unknown spacing {spacing!r}: choose one of {', '.join(SPACINGS)}")
    loops = cut_mesh.loops
    outer = np.flatnonzero(loops.outer)
    outer = outer[np.argsort(loops.chart[outer], kind="stable")]
    size = np.diff(loops.start)[outer]
    chart = np.repeat(np.arange(len(outer)), size)
    first = np.cumsum(size) - size
    local = np.arange(len(chart)) - first[chart]
    h = loops.half_edges[loops.start[outer][chart] + local]
    # begin where the surface's corner is sharpest: a choice that no renumbering changes
    sharp = _angles_at(cut_mesh, cut_mesh.faces.ravel()[h])
    order = np.lexsort((local, np.round(sharp, 9), chart))
    begin = local[order[first]]
    h = h[first[chart] + (local + begin[chart]) % size[chart]]
    length = np.ones(len(h))
    if spacing == "arc-length":
        length = cut_mesh.edge_lengths.ravel()[h]
        mean = group_sum(length, chart, len(size)) / size
        length = np.maximum(length, SHORTEST * mean[chart])
    total = group_sum(length, chart, len(size))
    share = length / total[chart]
    run = np.cumsum(share) - share
    place = np.clip(run - run[first[chart]], 0, 1)
    labels = loops.chart[outer][chart]
    return Ring(cut_mesh.faces.ravel()[h], labels, h, place, size)


def _angles_at(cut_mesh: CutMesh, vertices: IntArray) -> FloatArray:
    """(k,) sum of the corner angles at these vertices, from the faces that touch them only."""
    wanted = np.zeros(cut_mesh.n_vertices, bool)
    wanted[vertices] = True
    near = np.flatnonzero(wanted[cut_mesh.faces].any(1))
    part = CutMesh(
        cut_mesh.faces[near],
        cut_mesh.rest_triangles[near],
        cut_mesh.chart[near],
        cut_mesh.edges[:0],
    )
    sums = group_sum(corner_angles(part).ravel(), part.faces.ravel(), cut_mesh.n_vertices)
    return sums[vertices]


def circle(cut_mesh: CutMesh, options: TutteOptions) -> BoundarySegments:
    """A circle with the area of the chart: strictly convex everywhere."""
    ring = outer_ring(cut_mesh, options.spacing)
    angle = 2 * np.pi * ring.place
    radius = np.sqrt(cut_mesh.chart_areas / np.pi)[ring.chart]
    uv = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
    return BoundarySegments(cut_mesh, ring.vertices, uv)


def square(cut_mesh: CutMesh, options: TutteOptions) -> BoundarySegments:
    """A square with the area of the chart, a boundary vertex at each corner where there are four."""
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return _on_polygon(cut_mesh, outer_ring(cut_mesh, options.spacing), corners)


def polygon(cut_mesh: CutMesh, options: TutteOptions) -> BoundarySegments:
    """The convex polygon of the options, scaled to the area of the chart.

    Raises OptionError where there is none, or it is not convex.
    """
    if options.polygon is None:
        raise OptionError("the boundary 'polygon' needs its corners: --boundary polygon FILE")
    corners = check_polygon(options.polygon)
    return _on_polygon(cut_mesh, outer_ring(cut_mesh, options.spacing), corners)


def check_polygon(corners: FloatArray) -> FloatArray:
    """(k, 2) corners, counter-clockwise; raises OptionError unless they form a strictly convex polygon."""
    corners = np.asarray(corners, np.float64)
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


def _on_polygon(cut_mesh: CutMesh, ring: Ring, corners: FloatArray) -> BoundarySegments:
    """Lay rings on a polygon, a vertex at each corner; bend the sides whose faces would collapse."""
    k = len(corners)
    side = np.roll(corners, -1, 0) - corners
    length = np.hypot(side[:, 0], side[:, 1])
    target = np.r_[0.0, np.cumsum(length)] / length.sum()
    at = _corner_entries(ring, target[:k])
    # the side of every vertex, and how far along it
    start = ring.start
    local = np.arange(len(ring.vertices)) - start[ring.index]
    of = (local[:, None] >= at[ring.index]).sum(1) - 1
    fits = ring.size >= k
    free = ~fits[ring.index]  # fewer vertices than corners: simply along the perimeter
    of[free] = np.searchsorted(target, ring.place[free], side="right") - 1
    of = np.clip(of, 0, k - 1)
    begin = np.where(free, target[of], ring.place[start[ring.index] + at[ring.index, of]])
    after = np.append(at, ring.size[:, None], axis=1)[ring.index, of + 1]
    last = after >= ring.size[ring.index]
    after_place = ring.place[start[ring.index] + np.where(last, 0, after)]
    end = np.where(free, target[of + 1], np.where(last, 1.0, after_place))
    t = np.clip((ring.place - begin) / np.maximum(end - begin, 1e-300), 0, 1)
    bent = _sides_with_chords(cut_mesh, ring, of, t, k)
    exterior = np.arctan2(cross2(np.roll(side, 1, 0), side), (np.roll(side, 1, 0) * side).sum(1))
    turn = np.minimum(BULGE, np.minimum(exterior, np.roll(exterior, -1)) / 3)[of]
    turn = np.where(bent[ring.index, of], turn, 0.0)
    along, out = _arc(t, turn)
    normal = np.stack([side[:, 1], -side[:, 0]], 1)
    uv = corners[of] + along[:, None] * side[of] + out[:, None] * normal[of]
    area = cross2(corners, np.roll(corners, -1, 0)).sum() / 2
    uv *= np.sqrt(cut_mesh.chart_areas / area)[ring.chart][:, None]
    return BoundarySegments(cut_mesh, ring.vertices, uv)


def _arc(t: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A point at share t of the arc over the unit segment that leaves it at angle ``turn``: (along, out)."""
    flat = turn <= 0
    a = np.where(flat, 1.0, turn)
    angle = a * (2 * t - 1)
    along = 0.5 + np.sin(angle) / (2 * np.sin(a))
    out = (np.cos(angle) - np.cos(a)) / (2 * np.sin(a))
    return np.where(flat, t, along), np.where(flat, 0.0, out)


def _corner_entries(ring: Ring, target: FloatArray) -> IntArray:
    """(n, k) entry within its ring of the vertex that takes each corner: the nearest, all different."""
    n, k = len(ring.size), len(target)
    key = 2.0 * ring.index + ring.place
    wanted = 2.0 * np.arange(n)[:, None] + target
    right = np.searchsorted(key, wanted)
    right = np.clip(right, ring.start[:, None], (ring.start + ring.size - 1)[:, None])
    left = np.maximum(right - 1, ring.start[:, None])
    nearer = np.abs(key[left] - wanted) <= np.abs(key[right] - wanted)
    at = np.where(nearer, left, right) - ring.start[:, None]
    step = np.arange(k)
    at = np.maximum.accumulate(at - step, axis=1) + step
    at[:, 0] = 0
    result: IntArray = np.minimum(at, np.maximum(ring.size[:, None] - k, 0) + step)
    return np.minimum(result, ring.size[:, None] - 1)


def _sides_with_chords(
    cut_mesh: CutMesh, ring: Ring, of: IntArray, t: FloatArray, k: int
) -> BoolArray:
    """(n, k): an inner edge joins two boundary vertices on this side (its corners included)."""
    n = len(ring.size)
    side = np.full(cut_mesh.n_vertices, -1)
    side[ring.vertices] = of
    corner = np.zeros(cut_mesh.n_vertices, bool)
    corner[ring.vertices] = t == 0
    h = cut_mesh.edges[:, 0]
    flat = cut_mesh.faces.ravel()
    i, j = flat[h], flat[next_half_edge(h)]
    on = (side[i] >= 0) & (side[j] >= 0)
    i, j = i[on], j[on]
    index = np.full(cut_mesh.n_charts, -1)
    index[ring.chart[ring.start]] = np.arange(n)
    chart = index[cut_mesh.vertex_chart[i]]
    out = np.zeros((n, k), bool)
    # a corner vertex (t = 0) belongs to its own side and to the one before it
    for a, b in ((0, 0), (1, 0), (0, 1), (1, 1)):
        si = (side[i] - a) % k
        sj = (side[j] - b) % k
        ok = (si == sj) & (corner[i] | (a == 0)) & (corner[j] | (b == 0))
        out[chart[ok], si[ok]] = True
    return out


def virtual(cut_mesh: CutMesh, options: TutteOptions) -> BoundarySegments:
    """A ring of virtual faces round the boundary, of which only the outer rim is fixed on a circle, so that the
    real boundary is free to move (Lee, Kim, Lee 2002). The whole is still a convex map: nothing flips.
    """
    ring = outer_ring(cut_mesh, options.spacing)
    extended, rim = _virtual_faces(cut_mesh, ring)
    angle = 2 * np.pi * ring.place
    area = cut_mesh.chart_areas * (1 + WIDTH) ** 2
    radius = np.sqrt(area / np.pi)[ring.chart]
    return BoundarySegments(
        extended, rim, np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
    )


# Width of the virtual ring, as a share of the radius of a circle with the perimeter of the chart.
WIDTH = 0.5


def _virtual_faces(cut_mesh: CutMesh, ring: Ring) -> tuple[CutMesh, IntArray]:
    """CutMesh with two virtual faces outside every boundary edge, behind the real ones, and the rim's vertices.

    Each edge carries an isosceles trapezoid, as if the boundary were a circle and the ring lay flat round it.
    """
    b = len(ring.vertices)
    start, index = ring.start, ring.index
    local = np.arange(b) - start[index]
    follower = start[index] + (local + 1) % ring.size[index]
    preceding = start[index] + (local - 1) % ring.size[index]
    base = cut_mesh.edge_lengths.ravel()[ring.half_edge]
    radius = group_sum(base, index, len(ring.size)) / (2 * np.pi)
    height = WIDTH * radius[index]
    top = base * (1 + WIDTH)
    i, j = ring.vertices, ring.vertices[follower]
    rim = cut_mesh.n_vertices + np.arange(b)
    # lower face: j, i, rim of i; upper face: j, rim of i, rim of j
    p = np.zeros((b, 4, 2))  # j, i, rim of i, rim of j, seen with the surface below
    p[:, 1, 0] = base
    p[:, 2, 0] = (base + top) / 2
    p[:, 3, 0] = (base - top) / 2
    p[:, 2:, 1] = height[:, None]
    faces = np.concatenate([np.stack([j, i, rim], 1), np.stack([j, rim, rim[follower]], 1)])
    lower = 3 * (len(cut_mesh.faces) + np.arange(b))
    upper = lower + 3 * b
    edges = np.concatenate(
        [
            cut_mesh.edges,
            np.stack([ring.half_edge, lower], 1),
            np.stack([lower + 2, upper], 1),
            # the side i → rim of i of an edge meets the side rim of j → j of the edge before it
            np.stack([lower + 1, upper[preceding] + 2], 1),
        ]
    )
    extended = CutMesh(
        np.concatenate([cut_mesh.faces, faces]),
        np.concatenate([cut_mesh.rest_triangles, p[:, :3], p[:, [0, 2, 3]]]),
        np.concatenate([cut_mesh.chart, ring.chart, ring.chart]),
        edges,
    )
    return extended, rim


_CONVEX = frozenset({"convex-boundary"})
BOUNDARIES: Table[BoundaryFunction] = Table(
    "border",
    Row("circle", circle, "a circle with the area of the chart", "Tutte 1963", _CONVEX),
    Row("square", square, "a square with the area of the chart", "Tutte 1963", _CONVEX),
    Row("polygon", polygon, "a convex polygon of your own", "Tutte 1963", _CONVEX),
    Row(
        "virtual",
        virtual,
        "a circle round a ring of virtual faces: the real boundary moves freely",
        "Lee, Kim and Lee 2002",
        frozenset({"free-boundary"}),
    ),
)
