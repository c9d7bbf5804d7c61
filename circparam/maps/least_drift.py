"""A layout without flipped faces and overlaps, as near a wanted layout as a linear program finds.

Only vertices near a fault move. With p the wanted places and x the new ones, the program is

    minimise    Σ_i t_i  +  n T  +  penalty · (violation of the rows)
    subject to  |x_i − p_i| ≤ t_i ≤ T          for each of the n moving vertices i
                height of face f at x  ≥  h    for every moving face, to first order
                n · (x_i − y_j(x))     ≥  h    for every vertex i inside another part of the boundary

where y_j is the nearest point of that part and n its normal. The program is solved again from each result,
because heights are not linear and removing one overlap can reveal another.
"""

from typing import Any

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import cross_areas, edge_keys, mask_of, next_half_edge, positions_in
from circparam.core.linalg import SparseMatrix
from circparam.core.linear_program import CHOOSE, least
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.boundary import BoundarySegments, boundary_in, turned_loops
from circparam.geometry.intersect import meeting
from circparam.geometry.overlap import overlaps
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.region import grow

# Tried on 19 layouts carried to 15 or 40 % of the faces: 40 rounds, one or all rounds of contacts, 1 or 3
# rings. Neither these nor no margin nor a penalty of 1e5 changed a drift by 0.001 texel.
MOST_ROUNDS = 12  # linear programs, each of which starts from the last result
CONTACT_ROUNDS = 3  # whose contacts stay constraints, so that a cured overlap does not return
REGION_RINGS = 2  # of vertices around a fault that may move
LEAST_HEIGHT_PAGES = 1e-5  # height of a face and width of a gap: 1/50 texel of 2048
END_MARGIN_EDGES = 0.1  # a vertex so far past the end of an edge stays on its right
VIOLATION_PENALTY = 1e3  # of a row against a vertex that moves as far; 10 gives faces up
DRIFT_DIRECTIONS = 16  # sides of the polygon for a circle of drift; 8 add 5 % to drifts


def _feet(contacts: IntArray, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of contacts (k, 3) at places x (nv, 2): ((k,) share along the edge of the foot of the vertex, (k,)
    distance to its right, (k, 2) its normal there)."""
    place, start, end = (x[contacts[:, i]] for i in range(3))
    along, away = end - start, place - start
    length = np.maximum(np.sqrt((along**2).sum(1)), 1e-150)
    out = np.stack([along[:, 1], -along[:, 0]], 1) / length[:, None]
    return (away * along).sum(1) / length**2, (away * out).sum(1), out


def _beside(share: FloatArray) -> BoolArray:
    """Whether feet lie on an edge, or just beyond an end."""
    return np.abs(share - 0.5) < 0.5 + END_MARGIN_EDGES


def mend(cut_mesh: CutMesh, wanted: FloatArray, sign: FloatArray) -> FloatArray:
    """(nv, 2) places near the wanted places (nv, 2), without flipped faces and crossing boundaries.

    sign: (m,) 1, or −1 for faces of clockwise charts. ``faults`` lists the faults that remain.
    """
    x = wanted.copy()
    met = [_contacts(cut_mesh, x)]
    seed = np.zeros(len(cut_mesh.faces), bool)
    for _ in range(MOST_ROUNDS):
        low = heights(x[cut_mesh.faces], sign)[0] < LEAST_HEIGHT_PAGES / 2
        if not low.any() and not len(met[-1]):
            break
        contacts = np.unique(np.concatenate(met[-CONTACT_ROUNDS:]), axis=0)
        seed |= low | mask_of(len(x), contacts)[cut_mesh.faces].any(1)
        x = _linear_step(cut_mesh, wanted, x, sign, grow(cut_mesh, seed, REGION_RINGS), contacts)
        met.append(_contacts(cut_mesh, x))
    return x


def faults(cut_mesh: CutMesh, x: FloatArray, sign: FloatArray) -> BoolArray:
    """(m,) bool: faces that are flipped at places x (nv, 2), that cross others, or whose chart lies in another.

    Of two overlapping charts the one with fewer faces is at fault: where both cross, or else as a whole.
    """
    n, chart = cut_mesh.n_charts, cut_mesh.chart
    wrong: BoolArray = heights(x[cut_mesh.faces], sign)[0] < LEAST_HEIGHT_PAGES / 4
    found = overlaps(cut_mesh, _stored(x))
    size = np.bincount(chart, minlength=n)
    boundary, pairs = _crossings(cut_mesh, _stored(x))
    a, b = boundary.half_edge[pairs].T // 3
    smaller = np.where(size[chart[a]] <= size[chart[b]], a, b)
    same = chart[a] == chart[b]
    wrong[np.r_[smaller, a[same], b[same]]] = True
    wrong[boundary.half_edge[turned_loops(boundary)] // 3] = True  # a flap folded out of a hole
    crossing = edge_keys(chart[a], chart[b], n)
    inside = found.pairs[~np.isin(edge_keys(found.pairs[:, 0], found.pairs[:, 1], n), crossing)]
    whole = mask_of(
        n, np.where(size[inside[:, 0]] <= size[inside[:, 1]], inside[:, 0], inside[:, 1])
    )
    return wrong | whole[chart]


def meetings(cut_mesh: CutMesh, x: FloatArray) -> IntArray:
    """(p, 2) boundary half-edges that cross at places x (nv, 2), within a chart or between charts."""
    boundary, pairs = _crossings(cut_mesh, _stored(x))
    return boundary.half_edge[pairs]


def _crossings(cut_mesh: CutMesh, x: FloatArray) -> tuple[BoundarySegments, IntArray]:
    """(the boundary at places x (nv, 2), (p, 2) pairs of its segments that cross)."""
    boundary = boundary_in(cut_mesh, x)
    pairs = [np.stack(meeting(boundary, between)[:2], 1) for between in (False, True)]
    return boundary, np.concatenate(pairs)


def _stored(x: FloatArray) -> FloatArray:
    """Places rounded as in files, because touching boundaries may cross after rounding."""
    return x.astype(np.float32).astype(np.float64)


def heights(p: FloatArray, sign: FloatArray) -> tuple[FloatArray, FloatArray]:
    """((m,) height of triangles (m, 3, 2) over the longest side, negative where turned; (m, 3, 2) its gradient
    by the corners). sign: (m,) 1, or −1 for faces of clockwise charts."""
    side = p[:, [2, 0, 1]] - p[:, [1, 2, 0]]  # across from each corner
    longest = np.maximum(np.sqrt((side**2).sum(2).max(1)), 1e-300)
    area = cross_areas(p)
    turned = np.stack([-side[:, :, 1], side[:, :, 0]], axis=2)
    by = sign / longest
    return area * by, turned * by[:, None, None]


def _contacts(cut_mesh: CutMesh, x: FloatArray) -> IntArray:
    """(k, 3) a vertex inside another part of the boundary, and the ends of the edge through which it leaves;
    the part lies to the left of the edge. Of the four ends of each crossing, the one that lies least deep."""
    x = _stored(x)
    boundary, pairs = _crossings(cut_mesh, x)
    flat = cut_mesh.faces.ravel()
    ends = np.stack([flat[boundary.half_edge], flat[next_half_edge(boundary.half_edge)]], 1)
    back = (boundary.start != x[ends[:, 0]]).any(1)  # mirrored charts are walked the other way
    ends[back] = ends[back, ::-1]
    # each end of each segment against the other segment: (p, 4, 3)
    own, other = pairs[:, [0, 0, 1, 1]], pairs[:, [1, 1, 0, 0]]
    vertex = ends[own, [0, 1, 0, 1]]
    contacts = np.concatenate([vertex[..., None], ends[other]], 2)
    share, away, _ = _feet(contacts.reshape(-1, 3), x)
    depth = -away.reshape(vertex.shape)
    # a corner of the face of the edge must stay on its left
    corner = (cut_mesh.faces[boundary.half_edge[other] // 3] == vertex[..., None]).any(2)
    ok = (depth > -LEAST_HEIGHT_PAGES) & ~corner & _beside(share).reshape(vertex.shape)
    best = np.where(ok, depth, np.inf).argmin(1)
    rows = np.flatnonzero(ok.any(1))
    return contacts[rows, best[rows]]


def _linear_step(
    cut_mesh: CutMesh,
    wanted: FloatArray,
    x: FloatArray,
    sign: FloatArray,
    region: BoolArray,
    contacts: IntArray,
) -> FloatArray:
    """The places after one linear program; vertices outside the region keep theirs. contacts: (k, 3)."""
    free = mask_of(len(x), cut_mesh.faces[region])
    moving = np.flatnonzero(free)
    n = len(moving)
    number = positions_in(len(x), moving)
    face = np.flatnonzero(free[cut_mesh.faces].any(1))
    height, gradient = heights(x[cut_mesh.faces], sign)
    contacts = contacts[_beside(_feet(contacts, x)[0])]
    t, gap, normal = _feet(contacts, x)
    # rows: vertex of the whole, gradient by its place
    row_face = _rows(number, cut_mesh.faces[face], gradient[face], n)
    share = np.stack([np.ones(len(t)), t - 1, -t], 1)
    row_gap = _rows(number, contacts, share[:, :, None] * normal[:, None], n)
    moves: SparseMatrix = sps.vstack([row_face, row_gap], format="csr")
    lack = sps.identity(moves.shape[0])
    blank = sps.csr_matrix((moves.shape[0], n + 1))
    need = LEAST_HEIGHT_PAGES - np.r_[height[face], gap]
    angle = 2 * np.pi / DRIFT_DIRECTIONS * np.arange(DRIFT_DIRECTIONS)
    turn = np.stack([np.cos(angle), np.sin(angle)], 1)
    disc = sps.kron(sps.identity(n), turn)
    far = sps.kron(sps.identity(n), np.ones((DRIFT_DIRECTIONS, 1)))
    away = (x - wanted)[moving]
    lacks = lack.shape[0]
    largest = sps.csr_matrix(np.ones((n, 1)))
    # unknowns: steps (2n), drifts (n), largest drift, what rows lack
    rows: list[list[Any]] = [
        [-moves, blank, -lack],
        [disc, -far, sps.csr_matrix((DRIFT_DIRECTIONS * n, 1 + lacks))],
        [sps.csr_matrix((n, 2 * n)), sps.identity(n), -largest, sps.csr_matrix((n, lacks))],
    ]
    matrix = sps.csc_matrix(sps.vstack([sps.hstack(row) for row in rows]))
    bound = np.r_[-need, -(away @ turn.T).ravel(), np.zeros(n)] / LEAST_HEIGHT_PAGES
    cost = np.r_[np.zeros(2 * n), np.ones(n), n, np.full(lacks, VIOLATION_PENALTY)]
    lowest = np.r_[np.full(2 * n, -np.inf), np.zeros(n + 1 + lacks)]
    solved = least(cost, matrix, bound, (lowest, np.full(len(cost), np.inf)), CHOOSE)
    if solved is None:
        return x
    out = x.copy()
    out[moving] += LEAST_HEIGHT_PAGES * solved[: 2 * n].reshape(-1, 2)
    return out


def _rows(number: IntArray, vertex: IntArray, gradient: FloatArray, n: int) -> SparseMatrix:
    """(r, 2n) rows of gradients (r, c, 2) by the places of vertices (r, c), without fixed vertices."""
    r, c = vertex.shape
    column = number[vertex]
    row = np.repeat(np.arange(r), c).reshape(r, c)
    ok = column >= 0
    at = 2 * column[ok][:, None] + [0, 1]
    where: Any = (np.repeat(row[ok], 2), at.ravel())
    return sps.csr_matrix((gradient[ok].ravel(), where), shape=(r, 2 * n))
