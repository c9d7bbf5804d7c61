"""The common refinement of two surfaces: their vertices, and where their edges cross in the domain.

All faces of both are straight triangles of the domain, each counter-clockwise. Every face of A and every face
of B therefore share a convex polygon or nothing. Edges of A walk over the faces of B by exact signs, and no
vertex may lie on an edge. The vertices of A are therefore first moved by a billionth of their edges, which is
invisible.
"""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, next_half_edge, ranges
from circparam.core.graph import components, cycles
from circparam.core.records import dataclass
from circparam.errors import InputError, NoResultError, OptionError
from circparam.formats.document import Document
from circparam.formats.materials import Textures, moved_layout
from circparam.formats.memory import PlainDocument
from circparam.maps.closed_mesh import ClosedMesh
from circparam.maps.cover import Cover, CoverPoints
from circparam.maps.geometries import counter_clockwise, determinants, signs_of
from circparam.maps.map_input import MapInput
from circparam.maps.places import on_file, on_half_edges, on_surface
from circparam.maps.solution import MapSolution
from circparam.maps.surface_map import Refinement, SurfaceMap
from circparam.mesh.mesh import Mesh, UVMap

EDGE_NOISES = (1e-9, 1e-7, 1e-6, 1e-5)  # of an edge, that vertices move by, tried in turn


@dataclass(frozen=True, eq=False)
class Crossings:
    """In order along the edges of A: the half-edge of A (its lower one), the half-edge of B through which it
    leaves a face, and the position along both."""

    edge_a: IntArray
    share_a: FloatArray
    edge_b: IntArray
    share_b: FloatArray


@dataclass(frozen=True, eq=False)
class Overlay:
    """faces (m, 3) of the refinement; the faces of both meshes that each is a part of, a (m,) and b (m,). Its
    vertices are the vertices of A, the vertices of B, and the crossings."""

    faces: IntArray
    a: IntArray
    b: IntArray
    crossings: Crossings


def overlay(a: Cover, b: Cover, on_b: CoverPoints) -> Overlay:
    """The common refinement; on_b: places of all vertices of A over B.

    Raises NoResultError if double precision cannot tell edges apart.
    """
    edge = np.linalg.norm(a.cones - np.roll(a.cones, 1, 1), axis=2).min(1)
    least = np.full((a.mesh.n, 1), np.inf)
    np.minimum.at(least[:, 0], a.mesh.faces.ravel(), np.repeat(edge, 3))
    shake = least * np.random.default_rng(0).uniform(-1, 1, a.vectors.shape)
    for noise in EDGE_NOISES:
        moved = replace(a, vectors=a.geometry.normal(a.vectors + noise * shake))
        if not counter_clockwise(moved.cones).all():
            continue
        there = b.found_again(moved.vectors, on_b)
        found = None if (there.weights <= 0).any() else _crossings(moved, b, there)
        out = None if found is None else _assembled(a.mesh, b.mesh, found)
        if out is not None:
            return out
    raise NoResultError(
        "the edges of the two surfaces lie on each other beyond double precision: no overlay; "
        "map without --overlay, or move one of the meshes"
    )


def _crossings(a: Cover, b: Cover, at: CoverPoints) -> Crossings | None:
    """All edges of A walk over B at once; None if one loses its way."""
    twin, other = a.mesh.twin, b.mesh.twin
    edges = np.flatnonzero(np.arange(len(twin)) < twin)
    f, k = edges // 3, edges % 3
    v = a.mesh.faces[f, k]
    into = np.linalg.inv(a.development.of(edges) @ at.turn[v])
    p = np.einsum("kij,kj->ki", into, a.cones[f, k])
    q = np.einsum("kij,kj->ki", into, a.cones[f, (k + 1) % 3])
    face, came = at.face[v], np.full(len(edges), -1)
    going = np.arange(len(edges))
    out: list[tuple[IntArray, FloatArray, IntArray, FloatArray]] = []
    for _ in range(4 * len(b.cones) + 4):
        cone = b.cones[face[going]]
        inside = np.stack(
            [signs_of(np.stack([cone[:, i], cone[:, (i + 1) % 3], q[going]], 1)) for i in range(3)],
            1,
        )
        going = going[~(inside > 0).all(1)]
        if len(going) == 0:
            break
        cone = b.cones[face[going]]
        side = np.stack(
            [signs_of(np.stack([p[going], q[going], cone[:, i]], 1)) for i in range(3)], 1
        )
        leaves = (side < 0) & (np.roll(side, -1, 1) > 0)
        leaves &= 3 * face[going][:, None] + np.arange(3) != came[going][:, None]
        if not (leaves.sum(1) == 1).all():
            return None
        i = leaves.argmax(1)
        h = 3 * face[going] + i
        rows = np.arange(len(going))
        c0, c1 = cone[rows, i], cone[rows, (i + 1) % 3]
        s0, s1 = determinants(c0, c1, p[going]), -determinants(c0, c1, q[going])
        t0, t1 = -determinants(p[going], q[going], c0), determinants(p[going], q[going], c1)
        if not ((s0 > 0) & (s1 > 0) & (t0 > 0) & (t1 > 0)).all():
            return None
        out.append((edges[going], s0 / (s0 + s1), h, t0 / (t0 + t1)))
        matrix = b.development.matrices[b.development.index[h]]
        p[going] = np.einsum("kij,kj->ki", matrix, p[going])
        q[going] = np.einsum("kij,kj->ki", matrix, q[going])
        came[going], face[going] = other[h], other[h] // 3
    else:
        return None
    empty = (edges[:0], np.zeros(0), edges[:0], np.zeros(0))
    edge, share, h, part = (np.concatenate(x) for x in zip(empty, *out, strict=True))
    order = np.argsort(edge, kind="stable")  # steps were appended in order
    return Crossings(edge[order], share[order], h[order], part[order])


def _assembled(m_a: ClosedMesh, m_b: ClosedMesh, x: Crossings) -> Overlay | None:
    """The faces between the parts of all edges; None if they do not close."""
    n, count = m_a.n + m_b.n, len(x.edge_a)
    own = np.arange(count)
    lower = np.minimum(x.edge_b, m_b.twin[x.edge_b])
    share = np.where(lower == x.edge_b, x.share_b, 1 - x.share_b)
    along = np.lexsort((share, lower))
    if (np.diff(share[along])[lower[along][1:] == lower[along][:-1]] <= 0).any():
        return None
    first = _Chains(m_a.faces, m_a.twin, 0, x.edge_a, own + n)
    second = _Chains(m_b.faces, m_b.twin, m_a.n, lower[along], along + n)
    follower = _followers(first, second, x)
    start = np.concatenate([first.start, second.start])
    label, order, size = cycles(follower)
    euler = n + count - len(start) // 2 + len(size)
    if euler != m_a.n - len(m_a.faces) // 2 or (size < 3).any():
        return None
    return _triangles((first, second), (label, order, size), start, x)


class _Chains:
    """The parts of the edges of one mesh: part s of an edge has the half-edges 2s along its lower half-edge and
    2s + 1 back. of (2p,): the half-edge of the mesh that each lies on; start (2p,): the vertex it leaves."""

    def __init__(
        self, faces: IntArray, twin: IntArray, shift: int, edge: IntArray, crossing: IntArray
    ) -> None:
        h = np.arange(len(twin))
        edges = np.flatnonzero(h < twin)
        number = np.searchsorted(edges, edge)
        counts = np.bincount(number, minlength=len(edges))
        parts = counts + 1
        self.first = np.cumsum(parts) - parts  # part of each edge
        self.last = self.first + counts
        self.edges, self.total = edges, int(parts.sum())
        where = np.repeat(np.arange(len(edges)), parts)
        begin = faces.ravel()[edges][where] + shift
        end = faces.ravel()[next_half_edge(edges)][where] + shift
        # crossing k of an edge ends its part k and begins part k + 1
        at = self.first[number] + ranges(counts)
        begin[at + 1] = crossing
        end[at] = crossing
        self.before = np.empty(int(crossing.max(initial=-1)) + 1, np.int64)
        self.before[crossing] = at  # the part that ends in a crossing; the next one begins there
        self.start = np.stack([begin, end], 1).ravel()
        self.of = np.stack([edges[where], twin[edges[where]]], 1).ravel()
        self.part = np.full(len(twin), -1)  # first part along each half-edge, and last one
        self.part[edges] = 2 * self.first
        self.part[twin[edges]] = 2 * self.last + 1
        self.final = np.full(len(twin), -1)
        self.final[edges] = 2 * self.last
        self.final[twin[edges]] = 2 * self.first + 1


def _followers(a: _Chains, b: _Chains, x: Crossings) -> IntArray:
    """(2p,) the next half-edge round the face on the left of each; half-edges of B are numbered behind those of
    A."""
    shift = 2 * a.total
    out = np.empty(shift + 2 * b.total, np.int64)
    for chains, move in ((a, 0), (b, shift)):
        h = np.arange(len(chains.part))
        out[chains.final[h] + move] = chains.part[next_half_edge(h)] + move
    n = len(a.before) - len(x.edge_a)
    vertex = n + np.arange(len(x.edge_a))
    a_in = 2 * a.before[vertex]  # forward into the crossing; + 2 forward out of it
    b_in = 2 * b.before[vertex] + shift
    # B's lower half-edge leads from the right of A to its left where it is the one that A leaves the face by
    left = b.of[b_in - shift] == x.edge_b
    to_left, to_right = np.where(left, b_in + 2, b_in + 1), np.where(left, b_in + 1, b_in + 2)
    from_right, from_left = np.where(left, b_in, b_in + 3), np.where(left, b_in + 3, b_in)
    out[a_in] = to_left
    out[from_right] = a_in + 1
    out[a_in + 3] = to_right
    out[from_left] = a_in + 2
    return out


def _triangles(
    chains: tuple[_Chains, _Chains],
    walks: tuple[IntArray, IntArray, IntArray],
    start: IntArray,
    x: Crossings,
) -> Overlay:
    """The polygons in fans of triangles, with the faces of both meshes round each."""
    label, order, size = walks
    parents = []
    shift = 2 * chains[0].total
    half = (np.arange(shift), np.arange(shift, len(label)))
    for k in (0, 1):
        own, across = half[k], half[1 - k]
        # parts connected across the edges of the other mesh lie in one face of this mesh
        count, group = components(len(size), label[across], label[across ^ 1])
        face = np.full(count, -1)
        face[group[label[own]]] = chains[k].of // 3
        parents.append(face[group])
    begin = np.cumsum(size) - size
    fans = np.repeat(np.arange(len(size)), size - 2)
    step = ranges(size - 2)
    corner = start[order]
    faces = np.stack(
        [corner[begin[fans]], corner[begin[fans] + step + 1], corner[begin[fans] + step + 2]], 1
    )
    return Overlay(faces, parents[0][fans], parents[1][fans], x)


def refinement(a: MapInput, b: MapInput, found: MapSolution) -> Refinement:
    """The common refinement of both files.

    Raises OptionError for surfaces with boundaries, NoResultError if double precision cannot tell edges
    apart.
    """
    if a.loops:
        raise OptionError(
            "--overlay: it is made for closed surfaces, and these have boundaries: close them, or leave it out"
        )
    made = overlay(*found.covers, found.on_b)
    one, two = (cover.mesh for cover in found.covers)
    x = made.crossings
    on_a = _joined(_corners(one), found.on_a, x.edge_a, x.share_a), one, a
    on_b = _joined(found.on_b, _corners(two), x.edge_b, x.share_b), two, b
    parents = np.stack(
        [s.surface.source[m.parent[f]] for f, m, s in ((made.a, one, a), (made.b, two, b))], 1
    )
    on_both = [on_file(on_surface(*places, mesh), side) for places, mesh, side in (on_a, on_b)]
    return Refinement(made.faces, parents, *on_both)


def _corners(mesh: ClosedMesh) -> CoverPoints:
    """The vertices of a mesh as places on it."""
    h = mesh.first_out
    return CoverPoints(h // 3, np.eye(3)[h % 3], np.zeros((0, 3, 3)))


def _joined(
    a: CoverPoints, b: CoverPoints, half_edge: IntArray, share: FloatArray
) -> tuple[IntArray, FloatArray]:
    """(face, weights) of the vertices of both meshes and of crossings along half-edges."""
    face, weights = on_half_edges(half_edge, share)
    return np.concatenate([a.face, b.face, face]), np.concatenate([a.weights, b.weights, weights])


@dataclass(frozen=True, eq=False)
class OverlayDocument(PlainDocument):
    """The overlay with the uv, colours and textures of the document it is a refinement of."""

    wears: Textures | None = None
    paint: FloatArray | None = None

    def textures(self) -> Textures | None:
        """Textures of the other document, face by face."""
        return self.wears

    def colours(self) -> FloatArray | None:
        """(m, 3, 3) colours of the corners."""
        return self.paint


def overlaid(a: Document, b: Document, mapped: SurfaceMap) -> tuple[Document, FloatArray]:
    """(the overlay at the places of A, (k, 3) its vertices on B). mapped: from A to B.

    Raises InputError if the map has no overlay.
    """
    made = mapped.overlay
    if made is None:
        raise InputError(
            "the map holds no overlay: make it again with circparam map --overlay, or leave out --overlay"
        )
    points = made.on_a.of(a.mesh.points, a.mesh.faces)
    parent = made.parents[:, 0]
    w = _weights(points[made.faces], a.mesh.points[a.mesh.faces[parent]])
    textures = a.textures()
    layout = a.uv(0 if textures is None else textures.uv_set) or a.uv(0)
    if textures is not None and layout is not None:
        layout, textures = moved_layout(layout, textures), replace(textures, moves=())
    layout = _layout(layout, made, w)
    if textures is not None:
        alpha = None if textures.alpha is None else textures.alpha[parent]
        textures = replace(
            textures,
            face=textures.face[parent],
            plain=textures.plain[parent],
            alpha=alpha,
            uv_set=0,
        )
    colours = a.colours()
    document = OverlayDocument(
        a.source,
        "arrays",
        Mesh(points, made.faces),
        (0,) if layout is not None else (),
        layout=layout,
        wears=textures,
        paint=None if colours is None else np.einsum("fkc,fcd->fkd", w, colours[parent]),
    )
    return document, made.on_b.of(b.mesh.points, b.mesh.faces)


def _layout(layout: UVMap | None, made: Refinement, w: FloatArray) -> UVMap | None:
    """The layout of A at corners with weights w (m, 3, 3) in its faces; corners that meet in uv share a row."""
    if layout is None or not len(layout.uv):
        return None
    index = layout.uv_faces[made.parents[:, 0]]
    uv = np.einsum("fkc,fcd->fkd", w, layout.uv[np.maximum(index, 0)]).reshape(-1, 2)
    rows = np.column_stack([made.faces.ravel(), np.round(uv, 9)])
    _, first, row = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    known = np.asarray((index >= 0).all(1)).repeat(3)
    return UVMap(uv[first], np.where(known, row.reshape(-1), -1).reshape(-1, 3))


def _weights(places: FloatArray, corners: FloatArray) -> FloatArray:
    """(m, 3, 3) barycentric weights of three places each, (m, 3, 3), in the planes of triangles (m, 3, 3)."""
    d, e = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(d, e)
    size = np.maximum((normal * normal).sum(1), 1e-300)[:, None]
    x = places - corners[:, :1]
    one = (np.cross(x, e[:, None]) * normal[:, None]).sum(2) / size
    two = (np.cross(d[:, None], x) * normal[:, None]).sum(2) / size
    w = np.clip(np.stack([1 - one - two, one, two], 2), 0, 1)
    return np.asarray(w / w.sum(2, keepdims=True), np.float64)
