"""CutMesh with holes, for methods that walk along one boundary: their loops joined to one by cuts."""

import numpy as np

from circparam.core.arrays import ends_of
from circparam.core.graph import Graph, nearest, spanning_forest
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, IntArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import corner_classes


def hole_vertices(cut_mesh: CutMesh) -> tuple[IntArray, IntArray, IntArray]:
    """The vertices round holes: (vertices (k,), hole of each (k,), number of vertices of each hole (h,)).

    Holes are the loops other than the outer boundary of a chart, in the order of ``cut mesh.loops``.
    """
    loops = cut_mesh.loops
    hole_of_loop = np.cumsum(~loops.outer) - 1
    on = np.flatnonzero(~loops.outer[loops.loop_of])
    vertices = cut_mesh.faces.ravel()[loops.half_edges[on]]
    return vertices, hole_of_loop[loops.loop_of[on]], np.diff(loops.start)[~loops.outer]


@dataclass(frozen=True, eq=False)
class Opened:
    """cut mesh: the same faces, cut until every chart has one boundary. origin: (their n_vertices,) the vertex
    each one was before. cut: (e,) the edges of the cut mesh before that were cut."""

    cut_mesh: CutMesh
    origin: IntArray
    cut: BoolArray


def open_holes(cut_mesh: CutMesh) -> Opened:
    """Cut every chart along short edge paths that join all its boundary loops to one, a tree over the loops.

    The paths form the shortest tree with edges from loop to loop along shortest paths. Mehlhorn (1988) finds
    the tree among the edges between the regions nearest to each loop. Cuts never split a chart; half-edges keep
    their numbers. A cut mesh without holes is returned unchanged.
    """
    cut = _joining_paths(cut_mesh)
    if not cut.any():
        return Opened(cut_mesh, np.arange(cut_mesh.n_vertices), cut)
    kept = cut_mesh.edges[~cut]
    n, corners = corner_classes(len(cut_mesh.faces), kept)
    origin = np.empty(n, np.int64)
    origin[corners.ravel()] = cut_mesh.faces.ravel()
    return Opened(CutMesh(corners, cut_mesh.rest_triangles, cut_mesh.chart, kept), origin, cut)


def _joining_paths(cut_mesh: CutMesh) -> BoolArray:
    """(e,) edges of the paths that join the loops of each chart."""
    loops = cut_mesh.loops
    cut = np.zeros(len(cut_mesh.edges), bool)
    if loops.outer.all():
        return cut
    a, b = ends_of(cut_mesh.faces, cut_mesh.edges[:, 0])
    length = cut_mesh.lengths(cut_mesh.edges[:, 0])
    n = cut_mesh.n_vertices
    on_loop = cut_mesh.faces.ravel()[loops.half_edges]
    loop = np.full(n, -1)
    loop[on_loop] = loops.loop_of
    graph = Graph(n, a, b, length)
    distance, before, source = nearest(graph.matrix, on_loop)
    region = np.where(source >= 0, loop[source], -1)
    bridge = np.flatnonzero((region[a] != region[b]) & (region[a] >= 0) & (region[b] >= 0))
    way = (distance[a] + length + distance[b])[bridge]
    tree = spanning_forest(len(loops.chart), region[a[bridge]], region[b[bridge]], way)
    bridge = bridge[tree]
    cut[bridge] = True
    cut[graph.trace(before, np.r_[a[bridge], b[bridge]])] = True
    return cut
