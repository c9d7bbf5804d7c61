"""Lay developable charts out exactly: rotations passed on from face to face, then one Poisson solve."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    edge_keys,
    ends_of,
    first_of_each,
    found_in,
    group_count,
    group_sum,
    mask_of,
    next_half_edge,
    positions_in,
)
from circparam.core.graph import Graph, nearest, spanning_forest, undirected
from circparam.core.linalg import Factor
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.hard.regions import curvature
from circparam.seams.prices import edge_costs
from circparam.solvers.poisson import from_jacobians

CHARGED = 0.5  # radians that a boundary turns other than round a hole in a plane; curvature of a cone's tip


def unroll(cut_mesh: CutMesh) -> FloatArray:
    """(nv, 2) every chart unrolled: exact where it is developable, with simple boundaries or flat holes.

    Each face takes the rotation that lays it beside its neighbour in a spanning tree over long edges; the
    layout with those Jacobians follows from one Poisson solve.
    """
    i, j = cut_mesh.edges.T
    length = cut_mesh.edge_lengths.ravel()[i]
    tree = spanning_forest(len(cut_mesh.faces), i // 3, j // 3, -length)
    turn = _passed_on(cut_mesh, tree, first_of_each(cut_mesh.chart, cut_mesh.n_charts))
    return from_jacobians(cut_mesh, _rotations(turn))[0]


def _rotations(turn: FloatArray) -> FloatArray:
    """(2, 2, m) rotations by angles (m,)."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, -s], [s, c]])


def _passed_on(cut_mesh: CutMesh, tree: IntArray, roots: IntArray) -> FloatArray:
    """(m,) rotations of rest triangles, passed on from the roots over a forest with one root a tree.

    tree: rows of ``cut_mesh.edges``. The rotation of a root is 0.
    """
    m = len(cut_mesh.faces)
    a, b = cut_mesh.edges[tree].T
    turn = _turns_across(cut_mesh, a, b)
    # the Laplacian of the forest, held at its roots
    ends = np.stack([a // 3, b // 3], 1)
    right = group_sum(np.stack([-turn, turn], 1).ravel(), ends.ravel(), m)
    diagonal = group_count(ends.ravel(), m).astype(np.float64)
    diagonal[roots] += 1.0
    every = np.arange(m)
    rows = np.concatenate([ends[:, 0], ends[:, 1], every])
    columns = np.concatenate([ends[:, 1], ends[:, 0], every])
    data = np.concatenate([np.full(2 * len(ends), -1.0), diagonal])
    return Factor(sps.csc_matrix((data, (rows, columns)), shape=(m, m))).solve(right)


def _turns_across(cut_mesh: CutMesh, a: IntArray, b: IntArray) -> FloatArray:
    """(k,) angles, −π to π, by which the faces of half-edges b are turned against those of a, beside them."""
    corner = cut_mesh.rest_triangles.reshape(-1, 2)
    (ax, ay), (bx, by) = ((corner[next_half_edge(h)] - corner[h]).T for h in (a, b))
    return np.mod(np.arctan2(ay, ax) - np.arctan2(by, bx), 2 * np.pi) - np.pi


def transported(cut_mesh: CutMesh, jacobian: FloatArray, moves: BoolArray) -> FloatArray:
    """(2, 2, m) Jacobians: those of faces that move ((m,) bool) bend along with the nearest face that does not.

    jacobian: of all faces. Each that moves keeps its shape and takes the rotation that lays it beside its
    neighbour on the shortest way to a face that stays.
    """
    i, j = cut_mesh.edges[:, 0] // 3, cut_mesh.edges[:, 1] // 3
    m = len(cut_mesh.faces)
    middle = cut_mesh.edge_lengths.mean(1)
    use = np.flatnonzero(moves[i] | moves[j])
    fringe = np.unique(np.r_[i[use][~moves[i[use]]], j[use][~moves[j[use]]]])
    if len(fringe) == 0:
        return jacobian
    links = undirected(m, i[use], j[use], middle[i[use]] + middle[j[use]])
    _, before, source = nearest(links, fringe)
    reached = moves & (source >= 0) & (before >= 0)
    key = edge_keys(i[use], j[use], m)
    child = np.flatnonzero(reached)
    step = edge_keys(child, before[child], m)
    p, q = cut_mesh.edges[use[found_in(key, step)]].T
    own = np.arctan2(jacobian[1, 0] - jacobian[0, 1], jacobian[0, 0] + jacobian[1, 1])
    # turns are added up along the paths, over twice as many steps each time
    turn, back = np.zeros(m), np.arange(m)
    turn[child] = np.where(q // 3 == child, 1.0, -1.0) * _turns_across(cut_mesh, p, q)
    back[child] = before[child]
    while (further := back[back] != back).any():
        turn[further] += turn[back[further]]
        back = back[back]
    turn += own[back]
    return np.where(reached, _rotations(turn), jacobian)


def slits(atlas: Atlas, which: BoolArray | None = None) -> BoolArray:
    """(e,) bool: cheapest paths that open charts whose boundaries and cone tips keep them from unrolling.

    A hole in a plane turns by −2π, and needs no slit; boundaries that turn otherwise (both ends of a tube) and
    cone tips are joined by a tree of paths. which: (n,) charts, None for all. Source of the tree: Mehlhorn
    (1988).
    """
    cut_mesh = atlas.cut_mesh()
    node, sites = _sites(cut_mesh, which)
    index = np.flatnonzero(~atlas.cut)  # of the edges of the cut mesh
    a, b = (node[end] for end in ends_of(cut_mesh.faces, cut_mesh.edges[:, 0]))
    cost = edge_costs(atlas)[index]
    ok = np.isfinite(cost) & (a != b)
    index, a, b, cost = index[ok], a[ok], b[ok], cost[ok]
    if len(sites) < 2 or len(a) == 0:
        return np.zeros(len(atlas.cut), bool)
    n = int(node.max()) + 1
    links = Graph(n, a, b, cost)
    distance, parent, source = nearest(links.matrix, sites)
    met = np.isfinite(distance[a]) & np.isfinite(distance[b]) & (source[a] != source[b])
    number = positions_in(n, sites)
    p, q = number[source[a[met]]], number[source[b[met]]]
    whole = distance[a[met]] + cost[met] + distance[b[met]]
    chosen = np.flatnonzero(met)[spanning_forest(len(sites), p, q, whole)]
    ways = links.trace(parent, np.r_[a[chosen], b[chosen]])
    return mask_of(len(atlas.cut), index[np.r_[chosen, ways]])


def _sites(cut_mesh: CutMesh, which: BoolArray | None) -> tuple[IntArray, IntArray]:
    """((nv,) node of every vertex, those of one boundary loop being one, (k,) nodes that must be joined)."""
    loops = cut_mesh.loops
    flat = cut_mesh.faces.ravel()
    node = np.arange(cut_mesh.n_vertices)
    n = cut_mesh.n_vertices
    defect, rim = curvature(cut_mesh)
    on = flat[loops.half_edges]
    node[on] = n + loops.loop_of
    turning = group_sum(defect[on], loops.loop_of, len(loops.chart))
    chart_of = np.r_[cut_mesh.vertex_chart, loops.chart]
    charged = np.r_[~rim & (np.abs(defect) > CHARGED), np.abs(turning + 2 * np.pi) > CHARGED]
    if which is not None:
        charged &= which[chart_of]
    # a lone site needs no slit
    several = np.bincount(chart_of[charged], minlength=cut_mesh.n_charts) > 1
    charged &= several[chart_of]
    used, node = np.unique(node, return_inverse=True)
    return node.reshape(-1), np.flatnonzero(charged[used])
