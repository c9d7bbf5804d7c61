"""Charts whose faces pair up to a grid of quads, laid out with straight rows and columns."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import first_of_each, group_count, group_sum, mask_of, next_half_edge
from circparam.core.graph import components
from circparam.core.linalg import Factor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import opposite_half_edges

# Of the extent of a chart: rounding of the solve that adds up widths, a million times that of float64.
WIDTH_ROUNDING_SHARE = 1e-10


@dataclass(frozen=True, eq=False)
class _Quads:
    """quad: (m,) lowest face of the quad of each face. side: (3m,) number 0 to 3 of each half-edge round its
    quad, counter-clockwise, −1 on diagonals. partner: (3m,) the half-edge across an inner side, else −1."""

    quad: IntArray
    side: IntArray
    partner: IntArray


def diagonals(cut_mesh: CutMesh, locked: BoolArray) -> IntArray:
    """(m,) the side (0 to 2) of each face that is a diagonal of its quad.

    locked: (e,) bool, edges inside polygons of the file. They are diagonals in charts of quads. Elsewhere the
    longest side of a face is the diagonal, as in any quad that is nearly rectangular.
    """
    m = len(cut_mesh.faces)
    inside = mask_of(3 * m, cut_mesh.edges[locked].ravel()).reshape(m, 3)
    other = group_count(cut_mesh.chart[inside.sum(1) != 1], cut_mesh.n_charts) > 0
    longest = cut_mesh.edge_lengths.argmax(1)
    return np.where(other[cut_mesh.chart], longest, inside.argmax(1))


def faces_pair_up(cut_mesh: CutMesh, diagonal: IntArray) -> BoolArray:
    """(n_charts,) bool: no face of the chart lies beside its diagonal alone. diagonal: see ``diagonals``."""
    is_diagonal = _is_diagonal(diagonal)
    i, j = cut_mesh.edges.T
    one = is_diagonal[i] != is_diagonal[j]
    return group_count(cut_mesh.chart[i[one] // 3], cut_mesh.n_charts) == 0


def _is_diagonal(diagonal: IntArray) -> BoolArray:
    """(3m,) bool: the half-edge is the diagonal of its face."""
    m = len(diagonal)
    return mask_of(3 * m, 3 * np.arange(m) + diagonal)


def grid_layout(cut_mesh: CutMesh, diagonal: IntArray) -> tuple[FloatArray, BoolArray]:
    """(uv (nv, 2), (n_charts,) which charts are grids): rows and columns straight and at right angles.

    diagonal: (m,) side of each face, see ``diagonals``. A chart is a grid if its faces pair up across their
    diagonals and four quads meet at every inner vertex. The sides of all quads must follow two families of edge
    loops. A face whose diagonal lies on the border counts as half a quad. Each row and each column gets the
    width of least symmetric Dirichlet energy, in units of the mesh, as if all quads had right angles. Charts
    that are no grid keep zeros.
    """
    m = len(cut_mesh.faces)
    is_diagonal, grid = _is_diagonal(diagonal), faces_pair_up(cut_mesh, diagonal)
    i, j = cut_mesh.edges.T
    both = is_diagonal[i] & is_diagonal[j]
    quad, second = np.arange(m), np.zeros(m, bool)
    low, high = np.sort(cut_mesh.edges[both] // 3, 1).T
    quad[high], second[high] = low, True
    side = np.full((m, 3), -1)
    for k in (1, 2):
        side[np.arange(m), (diagonal + k) % 3] = k - 1 + 2 * second
    partner = np.where(is_diagonal, -1, opposite_half_edges(m, cut_mesh.edges))
    quads = _Quads(quad, side.ravel(), partner)
    grid &= _regular(cut_mesh, quads, diagonal)
    uv = np.zeros((cut_mesh.n_vertices, 2))
    if not grid.any():
        return uv, grid
    direction, whole = _directions(cut_mesh, quads, grid)
    grid &= whole
    width = _widths(cut_mesh, quads)
    flat = cut_mesh.faces.ravel()
    h = np.flatnonzero((quads.side >= 0) & np.repeat(grid[cut_mesh.chart], 3))
    for axis in (0, 1):
        along, across = h[direction[h] % 2 == axis], h[direction[h] % 2 != axis]
        step = np.where(direction[along] < 2, width[along], -width[along])
        tail, head = flat[along], flat[next_half_edge(along)]
        level = components(cut_mesh.n_vertices, flat[across], flat[next_half_edge(across)])[1]
        uv[:, axis] = _summed(level[tail], level[head], step, int(level.max()) + 1)[level]
        reach = np.abs(uv[head, axis] - uv[tail, axis] - step) > WIDTH_ROUNDING_SHARE * np.ptp(
            uv[:, axis]
        )
        grid &= group_count(cut_mesh.chart[along[reach] // 3], cut_mesh.n_charts) == 0
    uv[~grid[cut_mesh.vertex_chart]] = 0.0
    return uv, grid


def _regular(cut_mesh: CutMesh, quads: _Quads, diagonal: IntArray) -> BoolArray:
    """(n_charts,) bool: four quads meet at each vertex that is not on the border."""
    n, first = cut_mesh.n_vertices, quads.quad == np.arange(len(quads.quad))
    tip = cut_mesh.faces[np.arange(len(first)), (diagonal + 2) % 3]
    around = group_count(cut_mesh.faces[first].ravel(), n) + group_count(tip[~first], n)
    wrong = ~cut_mesh.on_boundary & (around != 4)
    return group_count(cut_mesh.vertex_chart[wrong], cut_mesh.n_charts) == 0


def _directions(cut_mesh: CutMesh, quads: _Quads, charts: BoolArray) -> tuple[IntArray, BoolArray]:
    """((3m,) direction of each side: 0 to 3 for +u, +v, −u, −v; (n_charts,) where one turn of quads fits all).

    A node stands for each quad and each of its four turns, an edge for turns of neighbours that agree. A chart
    whose quads can be turned alike falls into four copies of itself.
    """
    m = len(quads.quad)
    h = np.flatnonzero((quads.partner > np.arange(3 * m)) & np.repeat(charts[cut_mesh.chart], 3))
    g = quads.partner[h]
    relative = (quads.side[h] - quads.side[g] + 2) % 4
    turn = np.arange(4)[:, None]
    here = 4 * quads.quad[h // 3] + turn
    there = 4 * quads.quad[g // 3] + (turn + relative) % 4
    copy = components(4 * m, here.ravel(), there.ravel())[1].reshape(m, 4)[quads.quad]
    first = first_of_each(cut_mesh.chart, cut_mesh.n_charts)
    mine = copy == copy[first, 0][cut_mesh.chart][:, None]
    torn = group_count(cut_mesh.chart[mine.sum(1) != 1], cut_mesh.n_charts) > 0
    direction = (quads.side + np.repeat(mine.argmax(1), 3)) % 4
    return direction, ~torn


def _widths(cut_mesh: CutMesh, quads: _Quads) -> FloatArray:
    """(3m,) length of each side: one for all sides that face each other across a row of quads.

    Faces of area A and side a stretched to the width w cost Σ A (w²/a² + a²/w²), least at w⁴ = Σ A a² / Σ A
    a⁻².
    """
    m = len(quads.quad)
    opposite = np.full((m, 4), -1)
    h = np.flatnonzero(quads.side >= 0)
    opposite[quads.quad[h // 3], quads.side[h]] = h
    facing = np.concatenate([opposite[:, [0, 2]], opposite[:, [1, 3]]])
    facing = facing[(facing >= 0).all(1)]
    across = np.flatnonzero(quads.partner > np.arange(3 * m))
    i = np.concatenate([facing[:, 0], across])
    j = np.concatenate([facing[:, 1], quads.partner[across]])
    count, row = components(3 * m, i, j)
    square, area = cut_mesh.edge_lengths.ravel() ** 2, np.repeat(cut_mesh.areas, 3)
    wide = group_sum(area * square, row, count) / group_sum(area / square, row, count)
    return wide[row] ** 0.25


def _summed(tail: IntArray, head: IntArray, step: FloatArray, n: int) -> FloatArray:
    """(n,) values with value[head] − value[tail] = step, if these agree; the lowest node of each part is 0."""
    ones = np.ones(len(tail))
    off = sps.coo_matrix((ones, (tail, head)), shape=(n, n))
    matrix = sps.diags(group_sum(np.r_[ones, ones], np.r_[tail, head], n)) - off - off.T
    parts, part = components(n, tail, head)
    root = mask_of(n, first_of_each(part, parts)).astype(np.float64)
    right = group_sum(np.r_[-step, step], np.r_[tail, head], n)
    return Factor((matrix + sps.diags(root)).tocsc()).solve(right)
