"""The common refinement of two surfaces: their vertices, and where their edges cross in the domain.

All faces of both are straight triangles of the domain, each counter-clockwise. Every face of A and every face
of B therefore share a convex polygon or nothing. Edges of A walk over the faces of B by exact signs, and no
vertex may lie on an edge. The vertices of A are therefore first moved by a billionth of their edges, which is
invisible.
"""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import group_min, next_half_edge, ranges, scattered
from circparam.core.graph import components, cycles
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, NoResultError, OptionError
from circparam.formats.document import Document
from circparam.formats.materials import moved_layout
from circparam.formats.memory import PlainDocument
from circparam.geometry.closest import closest_on_triangles
from circparam.maps.cover import Cover, CoverPoints
from circparam.maps.geometries import counter_clockwise, determinants, signs_of
from circparam.maps.map_input import ClosedMesh, MapInput
from circparam.maps.solution import MapSolution
from circparam.maps.surface_map import Places, Refinement, SurfaceMap
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


def refinement(a: MapInput, b: MapInput, found: MapSolution) -> Refinement:
    """The common refinement of both files.

    Raises OptionError for surfaces with boundaries, NoResultError if double precision cannot tell edges
    apart.
    """
    if a.loops:
        raise OptionError(
            "--overlay: it is made for closed surfaces, and these have boundaries: close them, or leave it out"
        )
    one, two = found.covers
    edge = np.linalg.norm(one.cones - np.roll(one.cones, 1, 1), axis=2).min(1)
    least = group_min(np.repeat(edge, 3), one.mesh.faces.ravel(), one.mesh.n)[:, None]
    shake = least * np.random.default_rng(0).uniform(-1, 1, one.vectors.shape)
    for noise in EDGE_NOISES:
        moved = replace(one, vectors=one.geometry.normal(one.vectors + noise * shake))
        there = two.found_again(moved.vectors, found.on_b)
        sound = counter_clockwise(moved.cones).all() and (there.weights > 0).all()
        x = _crossings(moved, two, there) if sound else None
        made = None if x is None else _assembled(one.mesh, two.mesh, x)
        if x is not None and made is not None:
            break
    else:
        raise NoResultError(
            "the edges of the two surfaces lie on each other beyond double precision: no overlay; "
            "map without --overlay, or move one of the meshes"
        )
    # vertices of A, vertices of B, crossings
    on_a, on_b = (Places(at.face, at.weights) for at in (found.on_a, found.on_b))
    places = (
        Places.joined(_corners(one.mesh), on_a, Places.along(x.edge_a, x.share_a)),
        Places.joined(on_b, _corners(two.mesh), Places.along(x.edge_b, x.share_b)),
    )
    faces, *own = made
    parents, on_both = [], []
    for side, mesh, face, at in zip((a, b), (one.mesh, two.mesh), own, places, strict=True):
        parents.append(side.surface.source[mesh.parent[face]])
        on_both.append(side.on_file(mesh.on_surface(at)))
    return Refinement(faces, np.stack(parents, 1), *on_both)


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
        rows, matrix = b.development.across(h)
        for end in (p, q):
            end[going[rows]] = np.einsum("kij,kj->ki", matrix, end[going[rows]])
        came[going], face[going] = other[h], other[h] // 3
    else:
        return None
    empty = (edges[:0], np.zeros(0), edges[:0], np.zeros(0))
    edge, share, h, part = (np.concatenate(x) for x in zip(empty, *out, strict=True))
    order = np.argsort(edge, kind="stable")  # steps were appended in order
    return Crossings(edge[order], share[order], h[order], part[order])


def _assembled(
    m_a: ClosedMesh, m_b: ClosedMesh, x: Crossings
) -> tuple[IntArray, IntArray, IntArray] | None:
    """(faces (m, 3) between the parts of all edges; the faces of A and of B that they lie in); None if they do
    not close. Vertices: those of A, those of B, the crossings."""
    n, count = m_a.n + m_b.n, len(x.edge_a)
    lower = np.minimum(x.edge_b, m_b.twin[x.edge_b])
    share = np.where(lower == x.edge_b, x.share_b, 1 - x.share_b)
    along = np.lexsort((share, lower))
    if (np.diff(share[along])[lower[along][1:] == lower[along][:-1]] <= 0).any():
        return None
    first = _Chains(m_a, 0, x.edge_a, np.arange(count) + n)
    second = _Chains(m_b, m_a.n, lower[along], along + n)
    start = np.concatenate([first.start, second.start])
    label, order, size = cycles(_followers(first, second, x, n))
    euler = n + count - len(start) // 2 + len(size)
    if euler != m_a.n - len(m_a.faces) // 2 or (size < 3).any():
        return None
    on_a, on_b = np.split(np.arange(len(label)), [len(first.start)])
    parents = []
    for chains, own, across in ((first, on_a, on_b), (second, on_b, on_a)):
        # parts connected across the edges of the other mesh lie in one face of this mesh
        pieces, group = components(len(size), label[across], label[across ^ 1])
        parents.append(scattered(pieces, group[label[own]], chains.of // 3)[group])
    begin = np.cumsum(size) - size
    fans, step = np.repeat(np.arange(len(size)), size - 2), ranges(size - 2)
    corner, at = start[order], begin[fans]
    faces = np.stack([corner[at], corner[at + step + 1], corner[at + step + 2]], 1)
    return faces, parents[0][fans], parents[1][fans]


class _Chains:
    """The parts of the edges of one mesh: part s of an edge has the half-edges 2s along its lower half-edge and
    2s + 1 back. of (2p,): the half-edge of the mesh that each lies on; start (2p,): the vertex it leaves; part:
    the first along each half-edge of the mesh; before: the part that ends in a crossing, the next begins there.
    """

    def __init__(self, mesh: ClosedMesh, shift: int, edge: IntArray, crossing: IntArray) -> None:
        flat, twin = mesh.faces.ravel(), mesh.twin
        edges = np.flatnonzero(np.arange(len(twin)) < twin)
        number = np.searchsorted(edges, edge)
        counts = np.bincount(number, minlength=len(edges))
        first = np.cumsum(counts + 1) - counts - 1
        along = np.repeat(edges, counts + 1)
        begin, end = flat[along] + shift, flat[next_half_edge(along)] + shift
        at = first[number] + ranges(counts)
        begin[at + 1] = end[at] = crossing
        self.before = np.empty(int(crossing.max(initial=-1)) + 1, np.int64)
        self.before[crossing] = at
        self.start = np.stack([begin, end], 1).ravel()
        self.of = np.stack([along, twin[along]], 1).ravel()
        self.twin, self.part = twin, np.empty(len(twin), np.int64)
        self.part[edges] = 2 * first
        self.part[twin[edges]] = 2 * (first + counts) + 1


def _followers(a: _Chains, b: _Chains, x: Crossings, n: int) -> IntArray:
    """(2p,) the next half-edge round the face on the left of each; half-edges of B are numbered behind those of
    A. n: vertices before the crossings."""
    shift = len(a.start)
    out = np.empty(shift + len(b.start), np.int64)
    for chains, move in ((a, 0), (b, shift)):
        last = chains.part[chains.twin] ^ 1
        out[last + move] = chains.part[next_half_edge(np.arange(len(last)))] + move
    a_in = 2 * a.before[n:]  # forward into each crossing; + 2 forward out of it
    b_in = 2 * b.before[n:] + shift
    # B's lower half-edge leads from the right of A to its left where it is the one that A leaves the face by
    left = b.of[b_in - shift] == x.edge_b
    to_left, to_right = np.where(left, b_in + 2, b_in + 1), np.where(left, b_in + 1, b_in + 2)
    from_right, from_left = np.where(left, b_in, b_in + 3), np.where(left, b_in + 3, b_in)
    out[a_in] = to_left
    out[from_right] = a_in + 1
    out[a_in + 3] = to_right
    out[from_left] = a_in + 2
    return out


def _corners(mesh: ClosedMesh) -> Places:
    """The vertices of a mesh as places on it."""
    return Places.along(mesh.first_out, np.zeros(mesh.n))


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
    corners = a.mesh.points[a.mesh.faces[parent]]
    w = closest_on_triangles(points[made.faces], corners[:, None])[0]
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
    document = PlainDocument(
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
