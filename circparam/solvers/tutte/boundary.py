"""BOUNDARIES: positions of the outer boundary of every chart, before the inside is solved.

A boundary is one function of the cut mesh and the options. It returns the cut mesh to solve, the fixed vertices
and their places, all charts at once. Every chart's boundary is centred on the origin and encloses the area of
the chart; charts overlap, because packing is a later stage. Only ``virtual`` adds faces to the cut mesh.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, group_sum
from circparam.core.registry import Row, Table
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.tutte.outer import FixedBoundary, OuterBoundary, TutteOptions, outer_boundary
from circparam.solvers.tutte.polygon import on_polygon, on_square

BoundaryFunction: TypeAlias = Callable[[CutMesh, TutteOptions], FixedBoundary]

# Width of the ring of virtual faces, as a share of the radius of a circle with the perimeter of the chart.
WIDTH = 0.5


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
        extended, fixed, _circle_of(outer, cut_mesh.chart_areas * (1 + WIDTH) ** 2)
    )


def _with_virtual_faces(cut_mesh: CutMesh, outer: OuterBoundary) -> tuple[CutMesh, IntArray]:
    """(cut mesh with two virtual faces outside every boundary edge, after the real ones; (b,) outer
    vertices). Each edge carries an isosceles trapezoid, as if the boundary were a circle with the flat ring
    around it."""
    b = len(outer.vertices)
    index, follower, preceding = outer.index, outer.neighbour(1), outer.neighbour(-1)
    base = cut_mesh.edge_lengths.ravel()[outer.half_edge]
    radius = group_sum(base, index, len(outer.size)) / (2 * np.pi)
    height = WIDTH * radius[index]
    top = base * (1 + WIDTH)
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
            np.stack([lower + 1, upper[preceding] + 2], 1),
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
