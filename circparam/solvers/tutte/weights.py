"""Convex-combination weights of every inner vertex and its neighbours.

A scheme is one function of the cut mesh. It returns a pair (forward, backward) of (m, 3) arrays: the terms of
the face in the weight w_ij of its half-edge i → j, and in w_ji of the same edge read backwards. The function
``half_edge_weights`` adds the two faces of every edge up. All schemes are intrinsic (they read the rest
triangles only) and work on all charts at once; none needs a loop over vertices.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import cross2, group_sum, positions_in, stable_order
from circparam.core.graph import cycles
from circparam.core.registry import Row, Table
from circparam.core.types import FloatArray, IntArray
from circparam.geometry.intrinsic import corner_angles as angles_of
from circparam.geometry.intrinsic import cotangents, tan_half_angles, vertex_angle_sums
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import opposite_half_edges

WeightPair: TypeAlias = tuple[FloatArray, FloatArray]

WeightFunction: TypeAlias = Callable[[CutMesh], WeightPair]


def uniform(cut_mesh: CutMesh) -> WeightPair:
    """w_ij = 1 (Tutte 1963): half from each face of the edge."""
    half = np.full(cut_mesh.faces.shape, 0.5)
    return half, half


def circle(cut_mesh: CutMesh) -> WeightPair:
    """w_ij = tan(θ_l/2) + tan(θ_r/2), the angles at i on both sides of ij (Kim 2019, eq. 4, as printed)."""
    t = tan_half_angles(cut_mesh)
    return t, t[:, [1, 2, 0]]


def mean_value(cut_mesh: CutMesh) -> WeightPair:
    """w_ij = (tan(θ_l/2) + tan(θ_r/2)) / r_ij, the angles at i on both sides of ij (Floater 2003)."""
    t = tan_half_angles(cut_mesh)
    r = cut_mesh.edge_lengths
    return t / r, t[:, [1, 2, 0]] / r


def harmonic(cut_mesh: CutMesh) -> WeightPair:
    """w_ij = (cot α + cot β)/2, the angles opposite to ij (Pinkall, Polthier 1993)."""
    w = cotangents(cut_mesh)[:, [2, 0, 1]] / 2
    return w, w


def authalic(cut_mesh: CutMesh) -> WeightPair:
    """w_ij = (cot γ + cot δ) / r_ij², the angles at j beside ij (Desbrun, Meyer, Alliez 2002)."""
    c = cotangents(cut_mesh)
    square = cut_mesh.edge_lengths**2
    return c[:, [1, 2, 0]] / square, c / square


def floater(cut_mesh: CutMesh) -> WeightPair:
    """Mean over l of the barycentric coordinates of i in the ring triangle that the ray opposite to neighbour l
    hits. The ring is flattened by eq. 3 (Floater 1997, shape preserving). Zero on boundary vertices.
    """
    ring, h, angle = flat_rings(cut_mesh)
    r = cut_mesh.edge_lengths.ravel()[h]
    p = np.stack([r * np.cos(angle), r * np.sin(angle)], 1)
    size = np.bincount(ring)
    start = np.cumsum(size) - size
    # one global search: rings are 8 apart, angles lie in [0, 2π)
    opposite = np.where(angle >= np.pi, angle - np.pi, angle + np.pi)
    s = np.searchsorted(8.0 * ring + angle, 8.0 * ring + opposite, side="right") - 1
    t = start[ring] + (s + 1 - start[ring]) % size[ring]
    # barycentric coordinates of the centre
    w = np.stack([cross2(p[s], p[t]), cross2(p[t], p), cross2(p, p[s])], 1)
    w = w / w.sum(1, keepdims=True) / size[ring][:, None]
    total = np.bincount(np.concatenate([np.arange(len(h)), s, t]), w.T.ravel(), len(h))
    out = np.zeros(cut_mesh.faces.size)
    out[h] = total
    return out.reshape(-1, 3), np.zeros(cut_mesh.faces.shape)


def flat_rings(cut_mesh: CutMesh) -> tuple[IntArray, IntArray, FloatArray]:
    """The rings of all inner vertices, each counter-clockwise from angle 0, flattened by Floater's eq. 3.

    Returns (ring (k,) 0.. in ascending order of vertex, half-edge (k,) that leaves the centre, angle (k,) in
    [0, 2π)). A corner that would take π or more is limited to less than π. Otherwise the centre would lie
    outside its own ring and weights would be negative. On a plane this never happens.
    """
    twin = opposite_half_edges(len(cut_mesh.faces), cut_mesh.edges)
    flat = cut_mesh.faces.ravel()
    inner = ~cut_mesh.on_boundary
    h = np.flatnonzero(inner[flat])
    entry = positions_in(len(flat), h)
    follower = entry[twin[np.where(h % 3 == 0, h + 2, h - 1)]]
    number = np.cumsum(inner) - 1
    ring = number[flat[h]]
    _, walk, _ = cycles(follower)
    walk = walk[stable_order(ring[walk])]
    by_ring, ring, size = h[walk], ring[walk], np.bincount(ring)
    angles = angles_of(cut_mesh)
    raw = angles.ravel()[by_ring]
    theta = raw * (2 * np.pi / vertex_angle_sums(cut_mesh, angles)[inner])[ring]
    wide = theta >= np.pi  # at most one corner of a ring
    if wide.any():
        raised = np.maximum(raw[wide], 0.95 * np.pi)
        scale = np.ones(len(size))
        scale[ring[wide]] = (2 * np.pi - raised) / (2 * np.pi - theta[wide])
        theta *= scale[ring]
        theta[wide] = raised
    turned = np.cumsum(theta)
    first = (np.cumsum(size) - size)[ring]
    angle = turned - theta
    return ring, by_ring, np.clip(angle - angle[first], 0, 2 * np.pi * (1 - 1e-15))


def half_edge_weights(cut_mesh: CutMesh, scheme: WeightFunction) -> FloatArray:
    """(3m,) weight w_ij of every half-edge i → j, summed over both faces of its edge (one on a boundary)."""
    forward, backward = scheme(cut_mesh)
    w = forward.ravel().copy()
    other = backward.ravel()
    i, j = cut_mesh.edges[:, 0], cut_mesh.edges[:, 1]
    w[i] += other[j]
    w[j] += other[i]
    return w


def clamp_negative(cut_mesh: CutMesh, weights: FloatArray) -> FloatArray:
    """Weights, each raised to at least a thousandth of the mean size of its row, so all are positive.

    weights: (3m,) as from ``half_edge_weights``. Zero would be enough for the sign. Zero could also cut a
    vertex off from one side of its ring, which Tutte's theorem does not allow.
    """
    source = cut_mesh.faces.ravel()
    n = cut_mesh.n_vertices
    count = np.maximum(np.bincount(source, minlength=n), 1)
    floor = 1e-3 * group_sum(np.abs(weights), source, n) / count
    return np.maximum(weights, floor[source])


_POSITIVE = frozenset({"positive"})
_BOTH = frozenset({"positive", "reproduces-plane"})
_PLANE = frozenset({"reproduces-plane"})
WEIGHTS: Table[WeightFunction] = Table(
    "weight scheme",
    Row(
        "circle",
        circle,
        "tangents of half angles, as printed: fast, positive, angles between uniform and mean-value",
        'H. Kim, "Surface Parameterization Based on Circular Centering Property" (Kim 2019), eq. 4',
        _POSITIVE,
        "reproduces the plane only where all neighbours of a vertex are equally far from it",
    ),
    Row(
        "mean-value",
        mean_value,
        "mean value coordinates: positive and shape preserving",
        "Floater 2003, eq. 2.1",
        _BOTH,
    ),
    Row(
        "floater",
        floater,
        "shape preserving weights from flattened rings",
        "Floater 1997, eq. 3 and section 6",
        _BOTH,
    ),
    Row("uniform", uniform, "every neighbour counts the same", "Tutte 1963", _POSITIVE),
    Row(
        "harmonic",
        harmonic,
        "cotangent weights: the discrete harmonic map",
        "Pinkall and Polthier 1993; Eck et al. 1995",
        _PLANE,
        "positive, hence free of flips, only where the mesh is intrinsically Delaunay, or with --clamp",
    ),
    Row(
        "authalic",
        authalic,
        "weights of the discrete authalic map",
        "Desbrun, Meyer and Alliez 2002, eq. 5",
        _PLANE,
        "weights can be negative: free of flips only where none is, or with --clamp",
    ),
)
