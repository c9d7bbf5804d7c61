"""Close small holes while seams are decided: a mesh full of them is decided like one without."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import next_half_edge, ranges
from circparam.core.types import BoolArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface

LARGEST = 64  # edges of a hole that is closed
THIN = 0.01  # a hole stays open where a face over it is thinner than this share of its longest edge


def complexity(surface: Surface) -> int:
    """Two for each handle and one for each boundary: 2 − χ, summed over the components."""
    parts, _ = surface.charts(np.zeros(len(surface.edges), bool))
    edges = len(surface.edges) + len(surface.boundary)
    vertices = int(surface.corner_vertex.max()) + 1
    return 2 * parts - (vertices - edges + len(surface.faces))


def close_small_holes(surface: Surface) -> Surface:
    """The surface with a fan of faces over every small hole, behind its own faces; no new points.

    The longest boundary of each component stays open, and so does a hole that a fan does not cover without
    folds.
    """
    loops = surface.cut_mesh(np.zeros(len(surface.edges), bool)).loops
    size = np.diff(loops.start)
    small = ~loops.outer & (size >= 3) & (size <= LARGEST)
    m, h, loop = len(surface.faces), loops.half_edges, loops.loop_of
    start, position = surface.faces.ravel(), ranges(size)
    root = loops.start[:-1][loop]
    # the two edges at the root have no face of their own
    base = small[loop] & (position > 0) & (position < size[loop] - 1)
    fans = np.stack([start[next_half_edge(h)], start[h], start[h[root]]], 1)
    small &= ~np.isin(np.arange(len(size)), loop[base][_folds(surface, fans[base], loop[base])])
    base &= small[loop]
    if not base.any():
        return surface
    f = np.full(len(h), -1)
    f[base] = m + np.arange(int(base.sum()))
    first, last = base & (position == 1), base & (position == size[loop] - 2)
    at = np.flatnonzero(base)
    onward = at[~last[at]]
    pairs = [
        np.stack([h[at], 3 * f[at]], 1),
        np.stack([h[root[first]], 3 * f[first] + 1], 1),
        np.stack([3 * f[onward] + 2, 3 * f[onward + 1] + 1], 1),
        np.stack([h[np.flatnonzero(last) + 1], 3 * f[last] + 2], 1),
    ]
    edges = np.sort(np.concatenate([surface.edges, *pairs]), axis=1)
    locked = np.r_[surface.locked, np.zeros(len(edges) - len(surface.edges), bool)]
    price = np.ones(len(edges))
    if surface.price is not None:  # the new edges lie over holes: nothing is known of them
        price[: len(surface.edges)] = surface.price
    order = np.argsort(edges[:, 0], kind="stable")
    beside, rough = h[at] // 3, surface.roughness
    return replace(
        surface,
        faces=np.concatenate([surface.faces, fans[at]]),
        source=np.r_[surface.source, surface.source[beside]],
        reversed_faces=np.r_[surface.reversed_faces, surface.reversed_faces[beside]],
        edges=edges[order],
        locked=locked[order],
        price=None if surface.price is None else price[order],
        first=None if surface.first is None else np.r_[surface.first, surface.first[beside]],
        roughness=None if rough is None else rough.part(np.r_[np.arange(m), beside]),
    )


def _folds(surface: Surface, fans: np.ndarray, loop: np.ndarray) -> BoolArray:
    """(k,) bool: the face over a hole is too thin, or looks away from the others over it."""
    p = surface.points[fans]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    longest = (((p - np.roll(p, 1, axis=1)) ** 2).sum(2)).max(1)
    total = np.zeros((int(loop.max(initial=-1)) + 1, 3))
    np.add.at(total, loop, normal)
    with np.errstate(invalid="ignore"):
        sound = (normal * total[loop]).sum(1) > 0
    sound &= np.linalg.norm(normal, axis=1) > THIN * longest
    return ~sound


def without_fans(atlas: Atlas, surface: Surface) -> Atlas:
    """Seams and layout of the surface itself from those of the one with closed holes."""
    m = len(surface.faces)
    own = atlas.surface.edges[:, 1] < 3 * m
    return Atlas(surface, atlas.cut[own], atlas.corners[:m])
