"""Places of vertices on the other closed mesh, along boundaries too; the same places on faces of the files."""

import numpy as np

from circparam.core.arrays import interpolated
from circparam.core.types import FloatArray, IntArray
from circparam.maps.closed_mesh import ClosedMesh
from circparam.maps.cover import CoverPoints
from circparam.maps.landmarks import Landmarks
from circparam.maps.map_input import MapInput
from circparam.maps.surface_map import Places


def along_boundaries(
    a: MapInput, b: MapInput, marks: Landmarks, mesh: ClosedMesh
) -> tuple[IntArray, CoverPoints]:
    """(vertices (k,) on the boundaries of A, their places on the mesh of B).

    Between two corners, by length. The edges along boundaries are never split, so they are those of the
    surface.
    """
    vertices, half_edges, shares = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
    for corners in marks.corners:
        loop_a, at_a = _unrolled(a, [marks.a[c] for c in corners])
        loop_b, at_b = _unrolled(b, [marks.b[c] for c in corners])
        k = np.clip(np.searchsorted(at_b, at_a, side="right") - 1, 0, len(loop_b) - 1)
        end = np.r_[at_b[1:], float(len(corners))]
        vertices.append(loop_a)
        half_edges.append(mesh.half_edges(loop_b, np.roll(loop_b, -1))[k])
        shares.append(np.clip((at_a - at_b[k]) / (end[k] - at_b[k]), 0, 1))
    on = on_half_edges(np.concatenate(half_edges), np.concatenate(shares))
    turn = np.broadcast_to(np.eye(3), (len(on.face), 3, 3))
    return np.concatenate(vertices), CoverPoints(on.face, on.weights, turn)


def _unrolled(side: MapInput, corners: list[int]) -> tuple[IntArray, FloatArray]:
    """(a boundary from its first corner on, the position of each vertex: corners passed, and the share to the
    next)."""
    loop = side.loops[int(side.on_boundary[corners[0]])]
    loop = np.roll(loop, -int(np.flatnonzero(loop == corners[0])[0]))
    run = side.closed.shares(np.r_[loop, loop[0]])
    at = np.array([int(np.flatnonzero(loop == c)[0]) for c in corners] + [len(loop)])
    place = np.asarray(np.interp(run, run[at], np.arange(len(at), dtype=np.float64)), np.float64)
    return loop, place[:-1]


def on_half_edges(half_edge: IntArray, share: FloatArray) -> Places:
    """Places (k) so far along half-edges."""
    k, t = half_edge % 3, share[:, None]
    return Places(half_edge // 3, (1 - t) * np.eye(3)[k] + t * np.eye(3)[(k + 1) % 3])


def on_surface(places: Places, mesh: ClosedMesh) -> Places:
    """Places on a closed mesh as places on the surface that it closes."""
    weights = np.maximum(interpolated(places.weights, mesh.corners[places.face]), 0)
    return Places(mesh.parent[places.face], weights / weights.sum(1, keepdims=True))


def for_file(places: Places, source: MapInput, target: MapInput) -> Places:
    """Places (by vertices of the surface, on faces of the other surface) by vertices and faces of the files.

    Vertices that no face uses get the first corner of the first face.
    """
    vertex = np.maximum(source.vertex, 0)
    found = on_file(places.take(vertex), target)
    unused = source.vertex < 0
    found.weights[unused], found.face[unused] = [1.0, 0.0, 0.0], 0
    return found


def on_file(places: Places, side: MapInput) -> Places:
    """Places on the faces of a surface as places on the faces of its file."""
    out = np.empty_like(places.weights)
    np.put_along_axis(out, side.surface.file_corners[places.face], places.weights, 1)
    return Places(side.surface.source[places.face], out)
