"""From the mesh of a file to the oriented manifold that is solved on, and back to all faces of the file.

Nothing is edited: points are welded by a map, faces are set aside or turned in a list, and a non-manifold
edge keeps pairs of its faces. ``complete`` undoes all of it for the layout, so the file keeps every face,
its order and its winding.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sps
import scipy.sparse.csgraph as csgraph
from scipy.spatial import cKDTree

from circparam.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_of_runs,
    ranges,
)
from circparam.errors import InputError, OptionError, TopologyError
from circparam.manifold import Pairs, Sides, orient, pair_half_edges
from circparam.mesh import Mesh, UVMap
from circparam.topology import Surface

DEGENERATE = 1e-12  # a face with area <= this x longest edge² is degenerate
TINY = 1e-50  # also one whose edges are this much shorter than the longest: its squares underflow
POINT_PAIRS = 64  # more pairs within the weld tolerance than this a vertex: the tolerance is absurd


@dataclass(frozen=True)
class RepairOptions:
    """What repair may do.

    weld_eps: distance in units of the mesh up to which vertices count as one (0: exactly the same position
    only). allow: False raises TopologyError where anything would have to be repaired.
    """

    weld_eps: float = 0.0
    allow: bool = True


@dataclass(frozen=True, eq=False)
class Repairs:
    """What was done, as counts, face lists and one-line messages. Face and vertex numbers are the file's.

    weld: (n,) int64, vertex → the vertex it counts as. scale: the power of two by which the points of the
    surface are those of the mesh; 1 unless the mesh is so large or small that squares would leave the range
    of float64. kept: (k,) faces solved on (``Surface.source``). degenerate: (d,) faces set aside because
    they have no area. twins: (t,) faces set aside because an earlier one, twin_of (t,), has the same three
    points. turned: faces solved on with reversed winding. near_vertices: vertices welded only because of
    the tolerance. nonmanifold_edges: edges with more than two faces (of the kept ones).
    nonmanifold_vertices: vertices whose faces make several fans, without the ends of edges that were split.
    non_orientable: components that were cut open to have two sides, along mobius_edges edges.
    unreferenced: vertices that no face uses; never touched.
    """

    weld: IntArray
    scale: float
    kept: IntArray
    degenerate: IntArray
    twins: IntArray
    twin_of: IntArray
    turned: int = 0
    near_vertices: int = 0
    nonmanifold_edges: int = 0
    nonmanifold_vertices: int = 0
    non_orientable: int = 0
    mobius_edges: int = 0
    unreferenced: int = 0
    messages: list[str] = field(default_factory=list)

    @property
    def clean(self) -> bool:
        """Whether nothing had to be repaired."""
        return not self.messages

    def as_dict(self) -> dict[str, int]:
        """The counts, for a report."""
        return {
            "degenerate_faces": len(self.degenerate),
            "duplicate_faces": len(self.twins),
            "turned_faces": self.turned,
            "near_vertices": self.near_vertices,
            "nonmanifold_edges": self.nonmanifold_edges,
            "nonmanifold_vertices": self.nonmanifold_vertices,
            "non_orientable_components": self.non_orientable,
            "mobius_edges": self.mobius_edges,
            "unreferenced_vertices": self.unreferenced,
        }


def repair(mesh: Mesh, options: RepairOptions = RepairOptions()) -> tuple[Surface, Repairs]:
    """The oriented manifold of a mesh, and what had to be done for it.

    Raises InputError where no face has an area, TopologyError where something would have to be repaired and
    ``options.allow`` is False, OptionError where the weld tolerance is no distance or larger than the mesh.
    """
    scale = mesh_scale(mesh)
    points = mesh.points if scale == 1.0 else mesh.points * scale
    weld = weld_map(mesh, options.weld_eps)
    near = int((weld != mesh.weld).sum()) if options.weld_eps > 0 else 0
    welded = weld[mesh.faces]
    bad = degenerate_faces(points, welded)
    first = first_twins(welded, len(points))
    twin = (first != np.arange(len(welded))) & ~bad
    if mesh.polygons is not None:
        twin &= ~_part_of_another_polygon(mesh.polygons, first, twin, bad)
    kept = np.flatnonzero(~bad & ~twin)
    if len(kept) == 0:
        raise InputError(
            f"all {len(welded)} faces are degenerate (no area): there is nothing to unwrap"
        )
    faces = welded[kept]
    pairs = pair_half_edges(points, faces, None if mesh.polygons is None else mesh.polygons[kept])
    p = points[faces]
    areas = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    sides = orient(len(faces), areas, pairs)
    turned_faces = np.where(sides.turned[:, None], faces[:, [0, 2, 1]], faces)
    h = pairs.edges[sides.keep]
    h = np.where(sides.turned[h // 3], h - h % 3 + (2 - h % 3), h)
    h = np.sort(h, 1)
    order = np.argsort(h[:, 0], kind="stable")
    surface = Surface(
        points, turned_faces, kept, sides.turned, h[order], pairs.locked[sides.keep][order]
    )
    fans = _split_vertices(surface, np.r_[pairs.crowded, pairs.edges[~sides.keep, 0]])
    used = np.zeros(len(points), bool)
    used[mesh.faces] = True
    twins = np.flatnonzero(twin)
    degenerate = np.flatnonzero(bad)
    messages = _messages(surface, degenerate, twins, first[twins], near, pairs, fans, sides)
    if messages and not options.allow:
        raise TopologyError(
            "the mesh needs repair: "
            + "; ".join(messages)
            + ". Allow it by leaving out --no-repair"
        )
    return surface, Repairs(
        weld=weld,
        scale=scale,
        kept=kept,
        degenerate=degenerate,
        twins=twins,
        twin_of=first[twins],
        turned=int(sides.turned.sum()),
        near_vertices=near,
        nonmanifold_edges=len(pairs.crowded),
        nonmanifold_vertices=len(fans),
        non_orientable=sides.one_sided,
        mobius_edges=int((~sides.keep).sum()),
        unreferenced=int((~used).sum()),
        messages=messages,
    )


def weld_map(mesh: Mesh, eps: float = 0.0) -> IntArray:
    """(n,) vertex → the lowest vertex at its position, or joined to it by steps of at most ``eps``.

    eps is in units of the mesh. Raises OptionError where it is negative or not finite, or so large that
    whole neighbourhoods would fall together.
    """
    if not (np.isfinite(eps) and eps >= 0):
        raise OptionError(f"the weld tolerance must be a distance of at least 0, not {eps}")
    weld = mesh.weld
    if eps == 0:
        return weld
    used = np.zeros(len(weld), bool)
    used[mesh.faces] = True
    points = np.unique(weld[used])
    scale = mesh_scale(mesh)
    tree = cKDTree(mesh.points[points] * scale)
    radius = eps * scale
    if tree.count_neighbors(tree, radius) > (2 * POINT_PAIRS + 1) * len(points):
        raise OptionError(
            f"the weld tolerance {eps:g} joins whole neighbourhoods of vertices: give a smaller one"
        )
    near = tree.query_pairs(radius, output_type="ndarray").astype(np.int64)
    n = len(points)
    graph = sps.coo_matrix((np.ones(len(near), bool), (near[:, 0], near[:, 1])), shape=(n, n))
    count, labels = csgraph.connected_components(graph, directed=False)
    lowest = np.full(count, len(weld))
    np.minimum.at(lowest, labels, points)
    target = np.arange(len(weld))
    target[points] = lowest[labels]
    return target[weld]


def degenerate_faces(points: FloatArray, faces: IntArray) -> BoolArray:
    """(m,) bool: a repeated point, or an area <= 1e-12 x longest edge².

    Also faces 1e50 times smaller than the largest, whose squares float64 cannot hold.
    """
    p = points[faces]
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    span = np.maximum(np.abs(e1).max(1), np.abs(e2).max(1))
    # a power of two for each face: exact, so the areas are those of the plain formula where it works
    exponent = np.frexp(np.maximum(span, 1e-300))[1]
    e1, e2 = np.ldexp(e1, -exponent[:, None]), np.ldexp(e2, -exponent[:, None])
    area = 0.5 * np.linalg.norm(np.cross(e1, e2), axis=1)
    longest = np.max([(e1**2).sum(1), (e2**2).sum(1), ((e2 - e1) ** 2).sum(1)], 0)
    tiny = span <= TINY * span.max(initial=0.0)
    a, b, c = faces.T
    result: BoolArray = (area <= DEGENERATE * longest) | tiny | (a == b) | (b == c) | (c == a)
    return result


def first_twins(faces: IntArray, n_points: int) -> IntArray:
    """(m,) the first face with the same three points, in any order and winding (itself where it is that)."""
    a, b, c = np.sort(faces, 1).T
    if n_points < 2**21:
        key = (a * n_points + b) * n_points + c
        order = np.argsort(key, kind="stable")
        start = first_of_runs(key[order])
    else:
        order = np.lexsort((c, b, a))
        a, b, c = a[order], b[order], c[order]
        new = (a[1:] != a[:-1]) | (b[1:] != b[:-1]) | (c[1:] != c[:-1])
        start = np.flatnonzero(np.r_[True, new])
    first = np.empty(len(faces), np.int64)
    first[order] = np.repeat(order[start], np.diff(np.r_[start, len(order)]))
    return first


def _part_of_another_polygon(
    polygons: IntArray, first: IntArray, twin: BoolArray, bad: BoolArray
) -> BoolArray:
    """(m,) bool: the polygon of the face also has a face of its own, in a place where its twin's has none.

    A corner of a polygon has one uv, so such a face must lie with its polygon, wherever its twin lies.
    """
    own = np.zeros(int(polygons.max()) + 1, bool)
    own[polygons[~twin & ~bad]] = True
    result: BoolArray = own[polygons] & (polygons != polygons[first])
    return result


def complete(
    mesh: Mesh, surface: Surface, repairs: Repairs, uv: FloatArray, uv_faces: IntArray
) -> UVMap:
    """The layout of the surface's faces, carried to every face of the file.

    uv: (k, 2); uv_faces: (s, 3) into uv, for the faces of the surface. Corners of turned faces go back to
    the order of the file, so such a uv triangle is as clockwise as the face itself is wound backwards. A twin
    takes, corner by corner, the uv of the face that was kept. A degenerate face takes the uv of its points
    from one chart, that of its own polygon first; where that would cover an area which is not a gap of the
    chart, its middle corner moves to the nearer of the other two (all three lie on a line in space, so
    nothing of it shows). A degenerate face with no point on the surface takes one uv of the nearest face.
    """
    out = np.full(mesh.faces.shape, -1, np.int64)
    corners = np.where(surface.turned[:, None], uv_faces[:, [0, 2, 1]], uv_faces)
    out[surface.source] = corners
    welded = repairs.weld[mesh.faces]
    if len(repairs.degenerate):
        out[repairs.degenerate] = _degenerate_uv(mesh, surface, repairs, uv, uv_faces)
    if len(repairs.twins):
        same = welded[repairs.twins][:, :, None] == welded[repairs.twin_of][:, None, :]
        out[repairs.twins] = np.take_along_axis(out[repairs.twin_of], same.argmax(2), 1)
    return UVMap(uv, out)


def _degenerate_uv(
    mesh: Mesh, surface: Surface, repairs: Repairs, uv: FloatArray, uv_faces: IntArray
) -> IntArray:
    """(d, 3) uv vertices for the degenerate faces."""
    bad = repairs.degenerate
    points = repairs.weld[mesh.faces[bad]]
    chart = UVMap(uv, uv_faces).charts
    polygon = np.arange(len(mesh.faces)) if mesh.polygons is None else mesh.polygons
    # corners of the surface at the points of these faces, sorted by point
    wanted = np.zeros(len(mesh.points), bool)
    wanted[points] = True
    corner = np.flatnonzero(wanted[surface.faces.ravel()])
    at = surface.faces.ravel()[corner]
    order = np.argsort(at, kind="stable")
    corner, at = corner[order], at[order]
    low = np.searchsorted(at, points.ravel())
    number = np.searchsorted(at, points.ravel(), side="right") - low
    slot = np.repeat(np.arange(3 * len(bad)), number)  # 3 * degenerate face + corner
    corner = corner[np.repeat(low, number) + ranges(number)]
    face = slot // 3
    own = polygon[surface.source[corner // 3]] == polygon[bad[face]]
    where = chart[corner // 3]
    # one chart for each face: the polygon's own first, then the one with most of the points, then the lowest
    charts = int(chart.max()) + 1
    key, group = np.unique(face * charts + where, return_inverse=True)
    group = group.reshape(-1)
    present = np.zeros((len(key), 3), bool)
    present[group, slot % 3] = True
    score = present.sum(1) + 4 * (np.bincount(group, own, len(key)) > 0)
    rank = np.lexsort((key % charts, -score, key // charts))
    best = rank[first_of_runs(key[rank] // charts)]
    chosen = np.zeros(len(key), bool)
    chosen[best] = True
    ok = chosen[group]
    slot, corner, own = slot[ok], corner[ok], own[ok]
    rank = np.lexsort((corner, ~own, slot))
    rank = rank[first_of_runs(slot[rank])]
    out = np.full((len(bad), 3), -1)
    out[slot[rank] // 3, slot[rank] % 3] = uv_faces.ravel()[corner[rank]]
    homeless = (out < 0).all(1)
    if homeless.any():
        centre = surface.points[surface.faces].mean(1)
        place = surface.points[points[homeless]].mean(1)
        out[homeless] = uv_faces[cKDTree(centre).query(place)[1], 0][:, None]
    some = np.take_along_axis(out, (out >= 0).argmax(1)[:, None], 1)
    out = np.where(out < 0, some, out)
    return _flattened(surface, points, uv, uv_faces, out)


def _flattened(
    surface: Surface, points: IntArray, uv: FloatArray, uv_faces: IntArray, out: IntArray
) -> IntArray:
    """Move the middle corner of faces that would cover some uv area, unless they fill a gap of their chart."""
    a, b = out, out[:, [1, 2, 0]]
    used = uv_faces.ravel()
    following = uv_faces[:, [1, 2, 0]].ravel()
    n = len(uv)
    sides = used * n + following
    open_sides = sides[~np.isin(sides, following * n + used)]
    fills = np.isin(b * n + a, open_sides).all(1) | np.isin(a * n + b, open_sides).all(1)
    distinct: BoolArray = (a != b).all(1)
    move = np.flatnonzero(distinct & ~fills)
    if len(move):
        p = surface.points[points[move]]
        length = np.linalg.norm(p[:, [1, 2, 0]] - p, axis=2)  # of sides 01, 12, 20
        longest = length.argmax(1)
        middle = (longest + 2) % 3
        before = np.take_along_axis(length, ((middle + 2) % 3)[:, None], 1)[:, 0]
        after = np.take_along_axis(length, middle[:, None], 1)[:, 0]
        target = np.where(after <= before, (middle + 1) % 3, (middle + 2) % 3)
        out[move, middle] = out[move, target]
    return out


def mesh_scale(mesh: Mesh) -> float:
    """A power of two that brings the mesh to a size of about 1 where its own is outside 2^±50, else 1."""
    used = mesh.points[np.unique(mesh.faces)]
    span = float((used.max(0) / 2 - used.min(0) / 2).max())
    if span == 0:
        return 1.0
    exponent = int(np.frexp(span)[1])
    return (
        1.0 if abs(exponent) <= 50 else float(np.ldexp(1.0, int(np.clip(-exponent, -1000, 1000))))
    )


def _split_vertices(surface: Surface, apart: IntArray) -> IntArray:
    """Points whose faces make more than one fan, without the ends of the edges that were split (``apart``,
    half-edges in the winding of the file)."""
    corner = surface.corner_vertex.ravel()
    point = np.full(int(corner.max()) + 1, -1)
    point[corner] = surface.faces.ravel()
    fans = np.bincount(point, minlength=len(surface.points))
    face = surface.faces
    # turning a face swaps its corners 1 and 2: half-edge k becomes 2 − k
    k = np.where(surface.turned[apart // 3], 2 - apart % 3, apart % 3)
    fans[face[apart // 3, k]] = 0
    fans[face[apart // 3, (k + 1) % 3]] = 0
    return np.flatnonzero(fans > 1)


def _messages(
    surface: Surface,
    degenerate: IntArray,
    twins: IntArray,
    twin_of: IntArray,
    near: int,
    pairs: Pairs,
    fans: IntArray,
    sides: Sides,
) -> list[str]:
    """One line for each kind of repair, with its count and the first place."""
    out = []
    if near:
        out.append(f"{near} vertices within the weld tolerance of another count as one")
    if len(degenerate):
        out.append(
            f"{len(degenerate)} degenerate faces set aside (the first is face {degenerate[0]}); "
            "they take the uv of their points"
        )
    if len(twins):
        out.append(
            f"{len(twins)} duplicate faces set aside (the first is face {twins[0]}, the same three points "
            f"as face {twin_of[0]}); they take its uv"
        )
    if len(pairs.crowded):
        h = int(pairs.crowded[0])
        out.append(
            f"{len(pairs.crowded)} non-manifold edges split (the first is at face "
            f"{surface.source[h // 3]})"
        )
    if len(fans):
        out.append(f"{len(fans)} non-manifold vertices split (the first is vertex {fans[0]})")
    if sides.turned.any():
        first = surface.source[int(sides.turned.argmax())]
        out.append(
            f"{int(sides.turned.sum())} faces wound against their neighbours turned for the solve (the "
            f"first is face {first}); the file keeps its winding"
        )
    if sides.one_sided:
        out.append(
            f"{sides.one_sided} components with one side only (Möbius strips) cut along "
            f"{int((~sides.keep).sum())} edges"
        )
    return out
