"""From seams to a layout without a flip or an overlap: a chain of links that always ends.

A chart whose map is faulty goes on to the next link: the method that was asked for, an isometric map, the
chart split in two (several times), a convex map with positive weights, and in the end single faces, laid in
the plane as they are. Charts that are sound stay as they are; all faulty ones of a round are solved
together. A chart distorted beyond its bound is faulty where seams may be added: one that is crushed to
nothing would also shrink all others to nothing when it is packed at its size.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_count
from circparam.core.graph import components, distances, nearest
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError, OptionError, TopologyError
from circparam.geometry.distortion import chart_distortion
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.methods.base import Layout, MethodOptions
from circparam.methods.pins import Pins
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.single_faces import LARGEST, take_to_pieces

SOUND, FLIPPED, OVERLAPPING, DISTORTED = 0, 1, 2, 3
SPLITS = 12  # times that a chart may be halved before it is taken to pieces
CONVEX = SPLITS - 2  # from this many halvings on, charts take a convex map that nothing relaxes
STEPS = 100  # of relaxing a piece: sound ones need some 30, what creeps on after that is split
SINGLE_BELOW = 24  # a faulty chart with at most so many faces is taken to pieces at once


def flatten(
    surface: Surface,
    cut: BoolArray,
    start: FloatArray | None,
    method: str,
    options: MethodOptions,
    pins: FloatArray | None,
    monitor: Monitor,
) -> Cascade:
    """The first link: the method that was asked for, all charts at once.

    start: (m, 3, 2) a layout that comes with the seams, taken as it is; None to let the method make one.
    pins: (p, 3) vertex of the surface's points, u, v.
    """
    m = len(surface.faces)
    atlas = Cascade(surface, cut, np.zeros((m, 3, 2)), np.zeros(m, np.int64))
    if start is not None:
        atlas.corners = start
        return atlas
    cut_mesh = surface.cut_mesh(cut)
    if pins is not None:
        options = _with_pins(surface, cut_mesh, options, pins)
    layout = METHODS[method].function(cut_mesh, options, monitor)
    atlas.corners = layout.uv[cut_mesh.faces]
    atlas.notes += layout.notes
    atlas.stopped, atlas.iterations = layout.stopped, layout.iterations
    return atlas


def _with_pins(
    surface: Surface, cut_mesh: CutMesh, options: MethodOptions, pins: FloatArray
) -> MethodOptions:
    """Pins of mesh vertices as pins of the vertices of the cut mesh (a seam makes several of one)."""
    number = pins[:, 0].astype(np.int64)
    if len(np.unique(number)) < len(number):
        raise OptionError("--pin fixes a vertex twice: name each vertex once")
    bad = np.flatnonzero((number < 0) | (number >= len(surface.points)))
    vertex = np.full(len(surface.points), -1)
    vertex[surface.faces.ravel()] = cut_mesh.faces.ravel()
    if len(bad) == 0:
        bad = np.flatnonzero(vertex[number] < 0)
    if len(bad):
        raise OptionError(
            f"--pin names vertex {int(number[bad[0]])}, which no face uses: vertices count from 0"
        )
    copies = np.unique(np.stack([surface.faces.ravel(), cut_mesh.faces.ravel()], 1), axis=0)
    seam = np.bincount(copies[:, 0], minlength=len(surface.points))[number] > 1
    if seam.any():
        raise OptionError(
            f"--pin names vertex {int(number[seam][0])}, which lies on a seam: "
            "pin a vertex inside a chart or on the boundary of the mesh"
        )
    from dataclasses import replace

    return replace(options, pins=Pins(vertex[number], pins[:, 1:]))


def faults(cut_mesh: CutMesh, uv: FloatArray) -> tuple[IntArray, BoolArray]:
    """What is wrong with each chart, (n_charts,) SOUND, FLIPPED or OVERLAPPING; and the flipped faces (m,)."""
    finite = np.isfinite(uv[cut_mesh.faces]).all(axis=(1, 2))
    flipped = ~finite | (signs(np.where(np.isfinite(uv), uv, 0.0), cut_mesh.faces) <= 0)
    n = cut_mesh.n_charts
    fault = np.where(group_count(cut_mesh.chart[flipped], n) > 0, FLIPPED, SOUND)
    sound = fault == SOUND
    if sound.any():
        part, vertices, _ = cut_mesh.subset(sound)
        found = overlaps(part.faces, uv[vertices], part.chart, part.edges)
        fault[np.flatnonzero(sound)[found.self_overlapping]] = OVERLAPPING
    return fault, flipped


def settle(atlas: Cascade, may_split: bool, options: MethodOptions, monitor: Monitor) -> BoolArray:
    """Send faulty charts down the chain until none is left (or no link may be used); edits the atlas.

    Returns (n_charts,) the charts that stay faulty: only where ``may_split`` is False.
    """
    with monitor.stage("check"):
        fault = _all_faults(atlas, may_split, monitor)
    while (fault > 0).any():
        if not advance(atlas, fault, may_split, options, monitor):
            return fault > 0
        with monitor.stage("check"):
            fault = _all_faults(atlas, may_split, monitor)
    return fault > 0


def _all_faults(atlas: Cascade, may_split: bool, monitor: Monitor) -> IntArray:
    """(n_charts,) as ``faults``; also DISTORTED where seams may be added and there is time for it.

    Faces laid down one by one are as they have to be.
    """
    cut_mesh, uv = atlas.open()
    fault, _ = faults(cut_mesh, uv)
    if not may_split or monitor.expired:
        return fault
    n = cut_mesh.n_charts
    fixed = group_count(cut_mesh.chart[atlas.laid > 0], n) > 0
    may = (fault == SOUND) & ~fixed
    if may.any():
        part, vertices, _ = cut_mesh.subset(may)
        high = chart_distortion(part, uv[vertices]) > atlas.bound
        fault[np.flatnonzero(may)[high]] = DISTORTED
    return fault


def advance(
    atlas: Cascade, fault: IntArray, may_split: bool, options: MethodOptions, monitor: Monitor
) -> bool:
    """Take the faulty charts ((n_charts,) codes) one link further; False where no link is left."""
    surface = atlas.surface
    n, chart = surface.charts(atlas.cut)
    size = group_count(chart, n)
    tries = np.zeros(n, np.int64)
    np.maximum.at(tries, chart, atlas.tries)
    bad = fault > 0
    # an isometric map may do where the method failed
    again = bad & (tries == 0) & (fault == FLIPPED) & atlas.again
    split = bad & ~again if may_split else np.zeros(n, bool)
    split &= group_count(chart[atlas.laid >= LARGEST], n) == 0
    if not (again | split).any():
        return False
    with monitor.stage("repair layout"):
        small = (size == 1) | ((size <= SINGLE_BELOW) & (fault != DISTORTED))
        single = split & (small | (tries >= SPLITS) | monitor.expired)
        halve = split & ~single
        if halve.any():
            atlas.cut = atlas.cut | split_charts(surface, atlas.cut, halve)
            what = np.flatnonzero(halve)
            atlas.repairs.append(
                f"{len(what)} chart(s) split, of {_some(size[what])} faces: "
                f"{_causes(fault[halve])} in one piece"
            )
        if single.any():  # after the halving, which counts charts as they were
            take_to_pieces(atlas, single[chart])
        if again.any():
            atlas.repairs.append(
                f"{int(again.sum())} chart(s) mapped again: {_causes(fault[again])} at first"
            )
        atlas.tries = atlas.tries + bad[chart]
        todo = (again | halve)[chart]
        if todo.any():
            gentle = (atlas.tries >= CONVEX) | monitor.expired
            _solve_again(atlas, todo & ~gentle, "isometric", options, monitor)
            _solve_again(atlas, todo & gentle, "mean-value", options, monitor)
    return True


def _solve_again(
    atlas: Cascade, faces: BoolArray, method: str, options: MethodOptions, monitor: Monitor
) -> None:
    """Map the charts of some faces anew; where the method fails, they stay faulty and go on."""
    if not faces.any():
        return
    if method not in METHODS:
        method = "mean-value"
    _, chart = atlas.surface.charts(atlas.cut)
    _, local = np.unique(chart[faces], return_inverse=True)
    label = np.zeros(len(chart), np.int64)
    label[faces] = local
    cut_mesh, fid = atlas.surface.part_cut_mesh(atlas.cut, faces, label)
    try:
        layout: Layout = METHODS[method].function(
            cut_mesh, MethodOptions(tolerance=options.tolerance, max_iterations=STEPS), monitor
        )
        atlas.corners[fid] = layout.uv[cut_mesh.faces]
    except (NoResultError, TopologyError, np.linalg.LinAlgError, ArithmeticError):
        atlas.corners[fid] = np.nan


def split_charts(surface: Surface, cut: BoolArray, charts: BoolArray) -> BoolArray:
    """(e,) bool, new seams that halve charts ((n_charts,) bool): faces nearer to one of two far ends.

    Distances run over the dual graph (centroid to centroid); no seam runs along a locked edge, so polygons
    move as a whole. Pieces that fall apart become charts of their own.
    """
    _, chart = surface.charts(cut)
    faces = np.flatnonzero(charts[chart])
    local = np.full(len(chart), -1)
    local[faces] = np.arange(len(faces))
    e = np.flatnonzero(~cut & charts[chart[surface.edges[:, 0] // 3]])
    ends = local[surface.edges[e] // 3]
    centre = surface.points[surface.faces[faces]].mean(1)
    length = np.linalg.norm(centre[ends[:, 0]] - centre[ends[:, 1]], axis=1)
    floor = 1e-9 * float(length.mean()) if len(length) else 1.0
    weight = np.where(surface.locked[e], floor, np.maximum(length, floor))
    k = len(faces)
    graph = sps.coo_matrix((weight, (ends[:, 0], ends[:, 1])), shape=(k, k)).tocsr()
    label = chart[faces]
    _, first = np.unique(label, return_index=True)
    far = _farthest(graph, first, label)
    other = _farthest(graph, far, label)
    _, _, source = nearest(graph, np.r_[far, other], symmetric=False)
    # faces of one polygon follow the first of them
    glue = surface.locked[e]
    _, polygon = components(k, ends[glue, 0], ends[glue, 1])
    _, head = np.unique(polygon, return_index=True)
    side = np.isin(source, other)[head][polygon]
    new = np.zeros(len(cut), bool)
    new[e] = side[ends[:, 0]] != side[ends[:, 1]]
    return new


def _farthest(graph: sps.csr_matrix, sources: IntArray, label: IntArray) -> IntArray:
    """The face of each chart that is farthest from the chart's source (the first of equals)."""
    distance = distances(graph, sources, symmetric=False)
    distance = np.where(np.isfinite(distance), distance, -1.0)
    order = np.lexsort((np.arange(len(label)), -distance, label))
    _, first = np.unique(label[order], return_index=True)
    result: IntArray = order[first]
    return result


def _some(values: IntArray) -> str:
    shown = ", ".join(str(int(v)) for v in values[:4])
    return shown + (", ..." if len(values) > 4 else "")


def _causes(codes: IntArray) -> str:
    parts = []
    if (codes == FLIPPED).any():
        parts.append("faces flipped")
    if (codes == OVERLAPPING).any():
        parts.append("it overlapped itself")
    if (codes == DISTORTED).any():
        parts.append("distorted too much")
    return " or ".join(parts)
