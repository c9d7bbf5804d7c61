"""Arcs of the seams: the pieces that are glued or kept as a whole."""

import numpy as np

from circparam.core.arrays import group_sum, mask_of
from circparam.core.graph import chains
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas

CONE = 1.2  # radians of angle defect above which a vertex ends arcs


@dataclass(frozen=True, eq=False)
class Arcs:
    """Chains of cut edges between junctions: the pieces of seam that are glued or kept as a whole.

    edge: (c,) edge of the surface, arc: (c,) arc of that edge. left, right: (a,) charts on both sides, in
    ascending order. length: (a,). tip: (a,) bool, one end is free, so the arc can be zipped.
    """

    edge: IntArray
    arc: IntArray
    left: IntArray
    right: IntArray
    length: FloatArray
    tip: BoolArray


def arcs_of(atlas: Atlas, chart: IntArray, cone: float = CONE) -> Arcs:
    """The arcs of the seams of an atlas: chains between junctions, boundaries and cone points.

    chart: (m,) chart of each face. cone: radians of curvature that make a vertex one, round which gluing can be
    too much.
    """
    c = np.flatnonzero(atlas.cut)
    a, b = atlas.ends[0][c], atlas.ends[1][c]
    valence = np.bincount(np.concatenate([a, b]), minlength=atlas.n_vertices)
    through = (valence == 2) & ~atlas.on_boundary & (np.abs(atlas.angle_defects) <= cone)
    count, arc = chains(a, b, through)
    p, q = chart[atlas.surface.sides[:, c]]
    left, right = np.zeros(count, np.int64), np.zeros(count, np.int64)
    left[arc], right[arc] = np.minimum(p, q), np.maximum(p, q)
    free = (valence == 1) & ~atlas.on_boundary
    tip = mask_of(count, arc[free[a] | free[b]])
    return Arcs(c, arc, left, right, group_sum(atlas.lengths[c], arc, count), tip)
