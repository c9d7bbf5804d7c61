"""A decimated mesh on which seams are decided, with the cell of every fine vertex."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import (
    ends_of,
    first_of_each,
    group_count,
    group_sum,
    numbered,
    positions_in,
    sorted_distinct,
)
from circparam.core.graph import components, nearest, undirected
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.collapse import collapsed
from circparam.mesh.cut_mesh import rest_triangles_of
from circparam.mesh.halfedge import run_opposite, shared_edges, sort_by_edge
from circparam.mesh.surface import Surface
from circparam.seams.multires.holes import complexity

PROXY_FACES = 1_000  # faces of the proxy of a mesh in one piece
PROXY_ROOT = 8.0  # and at least so many times the root of the faces: charts of smoother ones break on the mesh
LOOP_FACES = 20  # faces of a proxy for each handle and hole: fewer would close them
SMALL_COMPONENT = 300  # faces; smaller components are taken over as they are
FRAGMENT = 16  # faces; smaller torn-off parts of a component are left out of the proxy
# noise of points before the collapse, in mean edges at each. A collapse inside a flat or along a tube has no
# error, so half the proxy were slivers. From 0.02 to 0.1 alike: drafts of nine surfaces from marching cubes
# with such places cost 0.40 as much in 0.23 of the time, 14 other meshes 1.00 in 0.89
NOISE_EDGES = 0.05
# coarse points are single precision: faces below this share of their longest edge squared are left out
LEAST_AREA = float(np.finfo(np.float32).eps)


@dataclass(frozen=True, eq=False)
class Proxy:
    """A coarse surface and the cell of every fine vertex.

    surface: the decimated surface. cell: (fine vertices,) vertex of the coarse surface's *points*; each cell
    is connected. apart: (k, 2) points of coarse edges that are no inner edges of the coarse surface although
    several faces meet there: seams, not boundaries.
    """

    surface: Surface
    cell: IntArray
    apart: IntArray


def pair_edges(points: FloatArray, faces: IntArray) -> tuple[Surface, IntArray]:
    """A surface from triangles that need not be manifold: only edges of two opposite half-edges are paired.

    Returns (surface, (k, 2) points of the edges with several faces that are not paired).
    """
    runs = sort_by_edge(faces, len(points))
    edges = shared_edges(faces)
    torn = runs.pairs[~run_opposite(faces, runs.pairs), 0]
    many = np.r_[runs.order[runs.head[runs.size > 2]], torn]
    surface = Surface(
        points,
        faces,
        np.arange(len(faces)),
        np.zeros(len(faces), bool),
        edges,
        np.zeros(len(edges), bool),
    )
    return surface, np.sort(np.stack(ends_of(faces, many), 1), axis=1)


def decimate(surface: Surface, target: int) -> Proxy:
    """A proxy of about ``target`` faces by quadric error (Garland and Heckbert 1997).

    The record of the collapses of fast-simplification tells which coarse vertex every fine vertex went into.
    Components of few faces are taken over unchanged.
    """
    points, faces = surface.vertex_points, surface.corner_vertex
    n = len(points)
    _, component = surface.components
    large = (np.bincount(component) > SMALL_COMPONENT)[component]  # (m,) faces that are collapsed
    root = np.arange(n)
    position = points.copy()
    if large.any():
        used = sorted_distinct(faces[large])
        local = positions_in(n, used)
        centre = points[used].mean(0)
        size = float(np.abs(points[used] - centre).max())
        pieces = len(sorted_distinct(component[large]))
        share = min(max(int(target * large.mean()), 4 * pieces), int(large.sum()))
        simple = local[faces[large]].astype(np.int32)
        noisy = _with_noise((points[used] - centre) / size, simple)
        moved, into = collapsed(noisy, simple, share)
        # each coarse vertex is named by the first fine vertex that went into it
        distinct, number = numbered(into)
        heads = first_of_each(number, len(distinct))
        root[used] = used[heads][number]
        position[used[heads]] = moved[into[heads]] * size + centre
    coarse = root[faces]
    alive = (
        (coarse[:, 0] != coarse[:, 1])
        & (coarse[:, 1] != coarse[:, 2])
        & (coarse[:, 0] != coarse[:, 2])
    )
    rest_triangles = rest_triangles_of(position[coarse])
    longest = np.maximum(rest_triangles[:, 1, 0] ** 2, (rest_triangles[:, 2] ** 2).sum(1))
    with np.errstate(invalid="ignore"):
        alive &= rest_triangles[:, 1, 0] * rest_triangles[:, 2, 1] > LEAST_AREA * longest
    keep = np.flatnonzero(alive)
    keep = keep[_main_parts(position, coarse[keep], component[keep])]
    coarse = coarse[keep]
    kept = sorted_distinct(coarse)
    number = positions_in(n, kept)
    proxy, apart = pair_edges(position[kept], number[coarse])
    proxy = replace(proxy, whole_area=surface.whole_area)
    cell = _settle(surface, number[root])
    return Proxy(priced(proxy, surface, cell), cell, apart)


def _with_noise(points: FloatArray, faces: npt.NDArray[np.int32]) -> FloatArray:
    """Points (n, 3), each moved at random by up to NOISE_EDGES of the mean of its edges along every axis.

    On noisy flats the error of a collapse grows with the edge, so that coarse faces come out of one size.
    """
    corner = points[faces]
    edge = np.sqrt(((corner[:, [1, 2, 0]] - corner) ** 2).sum(2))
    at_corner = (edge + edge[:, [2, 0, 1]]) / 2
    at = faces.ravel().astype(np.int64)
    mean = group_sum(at_corner.ravel(), at, len(points)) / group_count(at, len(points))
    noise = np.random.default_rng(0).uniform(-NOISE_EDGES, NOISE_EDGES, points.shape)
    return points + noise * mean[:, None]


def priced(proxy: Surface, surface: Surface, cell: IntArray) -> Surface:
    """The proxy with the prices of the surface: those of both cells that an edge joins, in the mean."""
    if surface.price is None:
        return proxy
    ends = cell[np.concatenate(ends_of(surface.corner_vertex, surface.edges[:, 0]))]
    known = ends >= 0
    weight = np.tile(surface.edge_lengths, 2)[known]
    n = len(proxy.points)
    total = group_sum(weight, ends[known], n)
    price = group_sum(weight * np.tile(surface.price, 2)[known], ends[known], n)
    price = np.where(total > 0, price / np.maximum(total, 1e-300), 1.0)
    a, b = ends_of(proxy.faces, proxy.edges[:, 0])
    price = (price[a] + price[b]) / 2
    return replace(proxy, price=price, weighted=surface.weighted)


def _main_parts(points: FloatArray, faces: IntArray, component: IntArray) -> BoolArray:
    """(m,) bool: the face is not in a fragment that the collapses tore off its component."""
    surface, _ = pair_edges(points, faces)
    count, part = components(len(faces), *surface.sides)
    size = np.bincount(part, minlength=count)
    largest = np.zeros(int(component.max()) + 1, np.int64)
    np.maximum.at(largest, component, size[part])
    return size[part] >= np.minimum(FRAGMENT, largest[component])


def _settle(surface: Surface, cell: IntArray) -> IntArray:
    """Give fine vertices whose coarse vertex lost its faces to the nearest cell of their component."""
    lost = cell < 0
    if not lost.any():
        return cell
    flat = surface.corner_vertex
    a, b = flat.ravel(), flat[:, [1, 2, 0]].ravel()
    n = len(cell)
    touch = np.unique(np.r_[a[~lost[a] & lost[b]], b[~lost[b] & lost[a]]])
    if len(touch) == 0:
        return cell
    near = lost[a] | lost[b]  # any other way leads through a vertex of ``touch``
    _, _, source = nearest(undirected(n, a[near], b[near], np.ones(int(near.sum()))), touch)
    fill = lost & (source >= 0)
    out = cell.copy()
    out[fill] = cell[source[fill]]
    return out


def proxy_faces(surface: Surface, size: float = 1.0) -> int:
    """How many faces a proxy should have; ``size``: times as many, but for handles and holes."""
    most = max(PROXY_FACES, PROXY_ROOT * np.sqrt(len(surface.faces)))
    return max(int(size * most), LOOP_FACES * complexity(surface))
