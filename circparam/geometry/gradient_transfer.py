"""Gradients of a layout as vectors in space: transferred to other faces by the least rotation."""

import numpy as np

from circparam.core.arrays import sorted_distinct, unit
from circparam.core.graph import nearest, undirected
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas


def space_gradients(atlas: Atlas) -> FloatArray:
    """(m, 2, 3): gradients of u and v of the current layout as vectors in space."""
    surface = atlas.surface
    p = surface.corners
    opposite = p[:, [2, 0, 1]] - p[:, [1, 2, 0]]
    hat = np.cross(surface.normals[:, None], opposite) / (2 * surface.areas)[:, None, None]
    d = atlas.corners - atlas.corners[:, :1]
    return np.einsum("fkd,fkx->fdx", d, hat)


def turn_gradients(gradients: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Rotate space gradients (m, 2, 3) with the least turn that takes the normals ``before`` to ``after``."""
    cosine = (before * after).sum(1)
    axis = np.cross(before, after)
    factor = 1 / np.maximum(1 + cosine, 1e-3)
    along = np.einsum("fx,fdx->fd", axis, gradients) * factor[:, None]
    return (
        gradients * cosine[:, None, None]
        + np.cross(axis[:, None], gradients)
        + axis[:, None] * along[:, :, None]
    )


def in_rest_axes(
    points: FloatArray, faces: IntArray, normals: FloatArray, gradients: FloatArray
) -> FloatArray:
    """(2, 2, m) Jacobians of the rest triangles from space gradients (m, 2, 3) in the planes of the faces.

    faces: (m, 3) of points (n, 3), with those unit normals (m, 3).
    """
    x = unit(points[faces[:, 1]] - points[faces[:, 0]])
    y = np.cross(normals, x)
    return np.stack(
        [np.einsum("fdx,fx->df", gradients, x), np.einsum("fdx,fx->df", gradients, y)], 1
    )


def nearest_known(atlas: Atlas, known: BoolArray) -> tuple[IntArray, BoolArray]:
    """(m,) the nearest known face ((m,) bool) in the chart of each face; (m,) bool: there is one."""
    surface = atlas.surface
    inner = ~atlas.cut
    fi, fj = surface.sides[:, inner]
    touch = ~known[fi] | ~known[fj]
    fi, fj, w = fi[touch], fj[touch], surface.edge_lengths[inner][touch]
    seeds = sorted_distinct(np.r_[fi[known[fi]], fj[known[fj]]])
    source = np.arange(len(known))
    have = known.copy()
    if len(seeds):
        m = len(known)
        _, _, near = nearest(undirected(m, fi, fj, w), seeds)
        fill = (near >= 0) & ~known
        source[fill] = near[fill]
        have |= fill
    return source, have


def spread(atlas: Atlas, gradients: FloatArray, known: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Give faces without a gradient that of the nearest known face of their chart, rotated to their plane.

    Returns (gradients, (m,) bool: the face has one now).
    """
    normals = atlas.surface.normals
    source, have = nearest_known(atlas, known)
    todo = np.flatnonzero(~known)
    out = gradients.copy()
    out[todo] = turn_gradients(gradients[source[todo]], normals[source[todo]], normals[todo])
    return out, have
