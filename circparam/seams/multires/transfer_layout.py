"""Transfer of charts and layout from a coarse surface to the fine one."""

import numpy as np

from circparam.core.arrays import (
    first_of_groups,
    group_count,
    group_max,
    group_sum,
    mask_of,
    norms3,
    numbered,
    slices,
    sorted_distinct,
)
from circparam.core.graph import nearest, undirected
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.gradient_transfer import (
    in_rest_axes,
    nearest_known,
    space_gradients,
    turn_gradients,
)
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.seams.moves.reroute import shorten
from circparam.seams.multires.decimate import Proxy
from circparam.seams.segmentation.arcs import arcs_of
from circparam.seams.segmentation.grow import DualGraph


def separate(fine: Atlas, graph: DualGraph, label: IntArray, clear: BoolArray) -> None:
    """Cut fine charts that hold several coarse ones (a path between them was not found) along their labels.

    label: (m,) coarse chart near each face, −1 for none. clear: (m,) bool, no seam is near.
    """
    _, chart = fine.charts()
    sure = np.flatnonzero(clear)
    width = int(label.max()) + 1
    pairs, inverse = numbered(chart[sure] * width + label[sure])
    area = group_sum(fine.surface.areas[sure], inverse, len(pairs))
    whole = group_max(area, pairs % width, width)
    much = area >= 0.3 * np.maximum(whole[pairs % width], 1e-300)
    several = group_count((pairs // width)[much], int(chart.max()) + 1) > 1
    seed = sure[much[inverse] & several[chart[sure]]]
    if len(seed) == 0:
        return
    before = fine.cut.copy()
    use = ~fine.cut & several[chart[fine.surface.sides[0]]]
    of_cell = np.full(graph.n, -1)
    of_cell[graph.cell[seed]] = label[seed]
    seeded = of_cell >= 0
    # only cells without a label look for one, so links between two that have theirs are left out
    link = use & ~(seeded[graph.tail] & seeded[graph.head])
    a, b = graph.tail[link], graph.head[link]
    sources = sorted_distinct(np.r_[a[seeded[a]], b[seeded[b]]])
    _, _, source = nearest(undirected(graph.n, a, b, graph.step[link]), sources)
    side = np.where(source >= 0, of_cell[np.maximum(source, 0)], of_cell)
    fine.cut |= use & (side[graph.tail] != side[graph.head])
    shorten(fine, 3, before)


def clear_of_seams(coarse: Atlas) -> BoolArray:
    """(m,) coarse faces with no corner on a seam."""
    a, b = coarse.ends
    on_seam = mask_of(coarse.n_vertices, np.r_[a[coarse.cut], b[coarse.cut]])
    touched = on_seam[coarse.surface.corner_vertex]
    return ~(touched[:, 0] | touched[:, 1] | touched[:, 2])


def nearest_coarse_face(fine: Surface, proxy: Proxy) -> IntArray:
    """(m,) a coarse face near every fine face, facing alike: among those round the cell of its first corner."""
    coarse = proxy.surface
    order = np.argsort(coarse.faces.ravel(), kind="stable")
    degree = group_count(coarse.faces.ravel(), len(coarse.points))
    first = np.cumsum(degree) - degree
    place = np.c_[coarse.points[coarse.faces].mean(1), coarse.normals]
    size = float(np.sqrt(coarse.areas.mean()))
    out = np.full(len(fine.faces), -1)
    for k in slices(len(out)):
        cell = proxy.cell[fine.corner_vertex[k, 0]]
        a, b, c = fine.faces[k].T
        here = np.c_[(fine.points[a] + fine.points[b] + fine.points[c]) / 3, fine.normals[k]]
        face = np.flatnonzero((cell >= 0) & (degree[cell] > 0))
        here, start, left = here[face], first[cell[face]], degree[cell[face]]
        best, found = np.full(len(face), np.inf), np.full(len(face), -1)
        turn = 0
        while len(face):  # the next face round each cell, all cells at once
            candidate = order[start + turn] // 3
            there = place[candidate]
            x, y, z = (there[:, 3:] * here[:, 3:]).T
            apart = norms3(there[:, :3] - here[:, :3]) / size + 0.5 * (1 - (x + y + z))
            nearer = apart < best
            best[nearer], found[nearer] = apart[nearer], candidate[nearer]
            turn += 1
            more = left > turn
            if not more.all():
                out[k][face[~more]] = found[~more]
                face, here, start, left = face[more], here[more], start[more], left[more]
                best, found = best[more], found[more]
    return out


def match_charts(fine: Atlas, label: IntArray) -> tuple[IntArray, BoolArray]:
    """((n,) coarse chart that each fine chart stands for, by the area they share; (n,) bool: it is the largest
    that does, others are slivers between paths). label: as for ``separate``."""
    n, chart = fine.charts()
    ok = label >= 0
    # not as a table of both: thousands of components would make millions of pairs
    width = int(label.max()) + 1
    pairs, inverse = numbered(chart[ok] * width + label[ok])
    shared = group_sum(fine.surface.areas[ok], inverse, len(pairs))
    of = pairs // width
    best = first_of_groups(of, -shared)
    main, area = np.zeros(n, np.int64), np.zeros(n)
    main[of[best]], area[of[best]] = pairs[best] % width, shared[best]
    # a chart without any coarse face (a component too small for the proxy) stands for itself
    return main, mask_of(n, first_of_groups(main, -area)) | (area == 0)


def drop_slivers(fine: Atlas, label: IntArray) -> IntArray:
    """Glue charts that stand for no coarse chart to the neighbour with the longest common seam.

    Returns (n,) the coarse chart that each chart then stands for. label: as for ``separate``.
    """
    for _ in range(6):
        main, real = match_charts(fine, label)
        if real.all():
            return main
        arcs, sliver = arcs_of(fine, fine.charts()[1]), ~real
        may = (arcs.left != arcs.right) & (sliver[arcs.left] | sliver[arcs.right])
        if not may.any():
            return main
        which = np.flatnonzero(may)
        side = np.where(sliver[arcs.left[which]], arcs.left[which], arcs.right[which])
        glue = which[first_of_groups(side, -arcs.length[which])]
        chosen = mask_of(len(arcs.left), glue)
        fine.cut[arcs.edge[chosen[arcs.arc]]] = False
    return match_charts(fine, label)[0]


def fine_targets(
    coarse: Atlas, fine: Atlas, near: IntArray, own: BoolArray, clear: BoolArray
) -> tuple[FloatArray, IntArray]:
    """((2, 2, m) Jacobians that the coarse layout asks of the fine faces, zero where it says nothing; (m,)
    coarse face that each is taken from, −1 for none).

    near: (m,) coarse face near each face. own: (m,) bool, that lies in the chart for which the chart of the
    face stands. clear: as for ``separate``.
    """
    gradients = space_gradients(coarse)
    surface, (_, chart) = fine.surface, fine.charts()
    known = own & clear
    # small charts may have no face clear of seams: there every face of its own counts
    none_clear = np.bincount(chart, known, int(chart.max()) + 1) == 0
    known |= own & none_clear[chart]
    nearby, have = nearest_known(fine, known)
    source = np.where(have, near[nearby], -1)
    rest, normals = coarse.surface.normals, surface.normals
    targets = np.empty((2, 2, len(near)))
    for k in slices(len(near)):
        turned = np.zeros((len(near[k]), 2, 3))
        # by way of the normal of the known face: the coarse one may look away from the others
        at, of = have[k], source[k][have[k]]
        turned[at] = turn_gradients(gradients[of], rest[of], normals[nearby[k][at]])
        far = at & ~known[k]
        turned[far] = turn_gradients(turned[far], normals[nearby[k][far]], normals[k][far])
        targets[..., k] = in_rest_axes(surface.points, surface.faces[k], normals[k], turned)
    return targets, source


def prolonged(coarse: Atlas, fine: Atlas, cut_mesh: CutMesh, source: IntArray) -> FloatArray:
    """(nv, 2) the coarse layout continued to the vertices of the fine surface, in the mean of their faces.

    source: (m,) coarse face whose map is taken for each fine face, −1: zero. Right but for what is near:
    errors are those of one coarse face against the next.
    """
    faces = np.flatnonzero(source >= 0)
    of = source[faces]
    gradients, surface = space_gradients(coarse), coarse.surface
    # each map as affine in space: uv = G p + offset
    first = surface.points[surface.faces[:, 0]]
    offset = coarse.corners[:, 0] - np.einsum("fdx,fx->fd", gradients, first)
    n = cut_mesh.n_vertices
    total, count = np.zeros((n, 2)), np.zeros(n)
    for k in range(3):
        p = fine.surface.points[fine.surface.faces[faces, k]]
        vertex = cut_mesh.faces[faces, k]
        value = np.einsum("fdx,fx->fd", gradients[of], p) + offset[of]
        count += group_count(vertex, n)
        total += group_sum(value, vertex, n)
    return total / np.maximum(count, 1)[:, None]


def cells_in_charts(fine: Surface, cut_mesh: CutMesh, proxy: Proxy) -> IntArray:
    """(nv,) label of the cell of each vertex of the cut mesh, one for each chart that a cell has parts in."""
    vertex = np.zeros(cut_mesh.n_vertices, np.int64)
    vertex[cut_mesh.faces.ravel()] = fine.corner_vertex.ravel()
    key = cut_mesh.vertex_chart * (len(proxy.surface.points) + 1) + proxy.cell[vertex] + 1
    return numbered(key)[1]


def take_over(fine: Atlas, coarse: Atlas, proxy: Proxy, near: IntArray) -> BoolArray:
    """Give components that decimation left as they were the seams they have; (m,) bool: their faces.

    near: (m,) coarse face of each face, in such components the same one.
    """
    surface = fine.surface
    n, component = surface.components
    same = (near >= 0) & (proxy.cell[surface.corner_vertex] == proxy.surface.faces[near]).all(1)
    same &= np.bincount(near[near >= 0], minlength=len(coarse.surface.faces))[near] == 1
    taken = ~mask_of(n, component[~same])[component]
    joined = mask_of(3 * len(coarse.surface.faces), coarse.surface.edges[~coarse.cut])
    edges = np.flatnonzero(taken[surface.sides[0]])
    h = surface.edges[edges]
    fine.cut[edges] = ~joined[3 * near[h // 3] + h % 3].all(1)
    return taken
