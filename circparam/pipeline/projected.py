"""Charts without time for a map: pieces of the surface that face one way, projected along that axis."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, IntArray, group_sum
from circparam.core.graph import components
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.pipeline.cascade import Cascade

# least share of its area with which a face may be seen along the axis of its neighbours
STEEP = 0.35
VOTES = 12  # rounds in which faces follow most of their neighbours
OWN = 0.5  # weight of the own axis in a vote, in boundary lengths


def project_charts(cascade: Cascade, faces: BoolArray) -> Cascade:
    """Cut charts with those faces ((m,) bool) where the axis that faces look along most changes.

    Every face lies as seen along that axis from outside, so no face is flipped. Costs no solve; but parts of a
    chart may lie behind each other.
    """
    surface = cascade.atlas.surface
    look = _axes(surface)
    inside = faces[surface.edges // 3].any(1) & ~surface.locked
    differ = look[surface.edges[:, 0] // 3] != look[surface.edges[:, 1] // 3]
    atlas = Atlas(surface, cascade.atlas.cut | (inside & differ), cascade.atlas.corners)
    fid = np.flatnonzero(faces)
    p = surface.points[surface.faces[fid]]
    axis, back = look[fid] % 3, look[fid] >= 3
    u, v = (axis + 1) % 3, (axis + 2) % 3
    u, v = np.where(back, v, u), np.where(back, u, v)
    row = np.arange(len(fid))
    atlas.corners[fid] = np.stack([p[row, :, u], p[row, :, v]], 2)
    return replace(cascade, atlas=atlas).repaired(
        f"{len(fid)} face(s) projected along the axes: out of time for a map"
    )


def _axes(surface: Surface) -> IntArray:
    """(m,) the axis that each face is seen along: x, y, z, then the other way; alike in a polygon.

    The axis nearest to the normal comes first. Neighbours then vote among axes that are nearly as good.
    """
    p = surface.points[surface.faces]
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    pairs = surface.edges // 3
    glue = pairs[surface.locked]
    n, polygon = components(len(area), glue[:, 0], glue[:, 1])
    normal = np.stack([group_sum(area[:, k], polygon, n) for k in range(3)], 1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    seen = np.concatenate([normal, -normal], 1)
    look = seen.argmax(1)
    i, j = polygon[pairs[~surface.locked]].T
    weight = surface.edge_lengths[~surface.locked]
    own = OWN * (np.bincount(i, weight, n) + np.bincount(j, weight, n))
    each = np.arange(n)
    for _ in range(VOTES):
        votes = np.bincount(6 * i + look[j], weight, 6 * n) + np.bincount(
            6 * j + look[i], weight, 6 * n
        )
        votes[6 * each + look] += own
        look = np.where(seen > STEEP, votes.reshape(n, 6), seen - 2).argmax(1)
    result: IntArray = look[polygon]
    return result
