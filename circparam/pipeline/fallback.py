"""From a layout to one without a flip or an overlap: a fallback cascade that always ends.

A faulty chart takes the next step: an isometric map, the chart split in two (several times), a convex map with
positive weights, and single faces laid in the plane. Sound charts stay; all faulty ones of a round are solved
together. With seams allowed, a chart above its bound is faulty too. A collapsed chart would shrink all others
at packing. Where time is up, charts are projected along the axes instead.
"""

from collections.abc import Callable
from dataclasses import field, replace

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    first_of_groups,
    group_count,
    group_max,
    group_sum,
    mask_of,
    normals_of,
    positions_in,
    ranges,
    unit,
)
from circparam.core.graph import components, distances, nearest
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import NoResultError, TopologyError
from circparam.geometry.distortion import chart_distortion
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.packing.options import Packed

# Mean distortion from which a chart is faulty under any bound. A chart scaled by 1 : 1400 has (s² + s⁻²) / 2
# = 10⁶ and fills 1.5 texels instead of 2048.
FAULTY_DISTORTION = 1e6
SOUND, FLIPPED, OVERLAPPING, DISTORTED = 0, 1, 2, 3
MOST_HALVINGS = 12  # times that a chart may be halved before it is taken to pieces
# from this many halvings on, charts take a convex map that nothing relaxes
CONVEX_HALVINGS = MOST_HALVINGS - 2
PIECE_STEPS = 100  # Newton steps for a piece: sound pieces need about 30, slower ones are split
PROJECTED_TRIES = 100  # steps counted for a projection, if there is no time for a map
LATE_BOUND = 3.0  # distortion from which on a projection, in more charts, is the better of the two
LATE_HALVINGS = 6  # times that such a chart may be halved
LATE_SINGLE_FACES = 100  # as SINGLE_FACES, where every round counts
SINGLE_FACES = 24  # a faulty chart with at most so many faces is taken to pieces at once
STAND_IN = 1e-3  # least side of a triangle that stands in: of √(surface area) or the longest edge
MOST_SINGLES = 8  # Cascade.singles at which no polygon that stands in grows any more
GROWTH_RATIO = 16.0  # by which such a side grows where even that is not held
# least share of its area with which a face may be seen along the axis of its neighbours
STEEP_SHARE = 0.35
VOTE_ROUNDS = 12  # rounds in which faces follow most of their neighbours
OWN_VOTE_WEIGHT = 0.5  # weight of the own axis in a vote, in boundary lengths


@dataclass(frozen=True)
class CascadeRules:
    """Limits of the cascade.

    may_split: seams may be added. remap: a flipped chart may be mapped by another method (not where the user
    asked for a convex map of a disk). bound: distortion above which a chart is split where it may be. method:
    options of the methods that map again.
    """

    may_split: bool = True
    remap: bool = True
    bound: float = FAULTY_DISTORTION
    method: MethodOptions = field(default_factory=MethodOptions)


@dataclass(frozen=True, eq=False)
class KnownPacking:
    """A packing of the charts with coordinates ``before`` (nv, 2)."""

    before: FloatArray
    packed: Packed


@dataclass(frozen=True, eq=False)
class Cascade:
    """A layout, and how far each chart has come; every step makes a new one.

    tries: (m,) int64, how many steps the chart of each face has been through. singles: (m,) int64, 1 for single
    faces, 2 and more for faces replaced by a regular polygon, larger each time. stopped, iterations: of each
    chart as the method made it. notes: of methods and seams. repairs: steps of the cascade, one line each.
    extent: a length of the whole surface, to which sizes of stand-ins are taken; its own where 0. packing: of
    this layout, where it was packed to be compared with another. advice: gain of cuts that only the user can
    allow, if they were tried.
    """

    atlas: Atlas
    rules: CascadeRules = field(default_factory=CascadeRules)
    tries: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    singles: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    stopped: list[str] = field(default_factory=list)
    iterations: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    notes: tuple[str, ...] = ()
    repairs: tuple[str, ...] = ()
    extent: float = 0.0
    packing: KnownPacking | None = None
    advice: str = ""

    def __post_init__(self) -> None:
        if self.extent == 0:
            surface = self.atlas.surface
            side = max(
                float(np.sqrt(surface.areas.sum())), float(surface.edge_lengths.max(initial=0.0))
            )
            object.__setattr__(self, "extent", side)
        for name in ("tries", "singles"):
            if len(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.zeros(len(self.atlas.surface.faces), np.int64))

    def open(self) -> tuple[CutMesh, FloatArray]:
        """The cut mesh along the seams, and the uv (nv, 2) of its vertices."""
        return self.atlas.open()

    def part(self, faces: BoolArray) -> "Cascade":
        """Some charts alone: those of faces (m,) bool, which hold whole charts."""
        tries, singles = self.tries[faces], self.singles[faces]
        return Cascade(self.atlas.part(faces), self.rules, tries, singles, extent=self.extent)

    def put(self, faces: BoolArray, part: "Cascade") -> "Cascade":
        """The atlas with the outcome of ``part(faces)``."""
        surface = self.atlas.surface
        atlas = Atlas(surface, self.atlas.cut, self.atlas.corners)
        atlas.put(faces, part.atlas)
        tries, singles = self.tries.copy(), self.singles.copy()
        tries[faces], singles[faces] = part.tries, part.singles
        after = replace(self, atlas=atlas, tries=tries, singles=singles)
        return after.noted(*part.notes).repaired(*part.repairs)

    def kept_sizes(self, cut_mesh: CutMesh) -> BoolArray:
        """(n_charts,) bool: charts whose size was chosen for the numbers to hold, and is not to be scaled."""
        return mask_of(cut_mesh.n_charts, cut_mesh.chart[self.singles >= 2])

    def noted(self, *notes: str) -> "Cascade":
        """The same with further notes, each once."""
        new = tuple(note for note in notes if note not in self.notes)
        return replace(self, notes=self.notes + new)

    def repaired(self, *repairs: str) -> "Cascade":
        """The same with further repairs."""
        return replace(self, repairs=self.repairs + repairs)


def faults(cut_mesh: CutMesh, uv: FloatArray) -> IntArray:
    """(n_charts,) the fault of each chart: SOUND, FLIPPED or OVERLAPPING."""
    finite = np.isfinite(uv[cut_mesh.faces]).all(axis=(1, 2))
    flipped = ~finite | (signs(np.where(np.isfinite(uv), uv, 0.0), cut_mesh.faces) <= 0)
    fault = np.full(cut_mesh.n_charts, SOUND)
    fault[cut_mesh.chart[flipped]] = FLIPPED
    sound = np.flatnonzero(fault == SOUND)
    if len(sound):
        part, vertices, _ = cut_mesh.subset(fault == SOUND)
        fault[sound[overlaps(part, uv[vertices]).self_overlapping]] = OVERLAPPING
    return fault


def settle(cascade: Cascade, monitor: Monitor) -> Cascade:
    """Take faulty charts through the cascade until none is left, or no step may be taken.

    Where seams may be added, charts above the bound are faulty too; single faces are always sound. Where time
    is up, only charts that are far beyond any bound are too distorted: those begun too late.
    """
    with monitor.stage("check"):
        cut_mesh, uv = cascade.open()
        fault = faults(cut_mesh, uv)
        if cascade.rules.may_split:
            bound, last = cascade.rules.bound, cascade.singles > 0
            if monitor.hurried:
                bound, last = max(bound, LATE_BOUND), last | (cascade.tries >= PROJECTED_TRIES)
            may = (fault == SOUND) & (group_count(cut_mesh.chart[last], cut_mesh.n_charts) == 0)
            if may.any():
                part, vertices, _ = cut_mesh.subset(may)
                high = chart_distortion(part, uv[vertices]) > bound
                fault[may] = np.where(high, DISTORTED, SOUND)
    return settle_faulty(cascade, fault, monitor, lambda part: settle(part, monitor))


def settle_faulty(
    cascade: Cascade, fault: IntArray, monitor: Monitor, settled: Callable[[Cascade], Cascade]
) -> Cascade:
    """Take the faulty charts ((n_charts,) codes) one step further and settle them, by themselves.

    Sound charts stay, so the cost of a round depends on the faulty charts alone. settled: takes a cascade on
    until it is sound, by this again. The same cascade where no step is left.
    """
    if not (fault > 0).any():
        return cascade
    faces = (fault > 0)[cascade.atlas.charts()[1]]
    after = advance(cascade.part(faces), fault[fault > 0], monitor)
    return cascade if after is None else cascade.put(faces, settled(after))


def advance(cascade: Cascade, fault: IntArray, monitor: Monitor) -> Cascade | None:
    """Take the faulty charts ((n_charts,) codes) one step further; None if no step is left."""
    atlas, rules = cascade.atlas, cascade.rules
    n, chart = atlas.charts()
    size = group_count(chart, n)
    tries = np.zeros(n, np.int64)
    np.maximum.at(tries, chart, cascade.tries)
    bad = fault > 0
    late = monitor.hurried and rules.may_split
    # an isometric map may do where the method failed
    again = bad & (tries == 0) & (fault == FLIPPED) & (rules.remap and not late)
    split = bad & ~again if rules.may_split else np.zeros(n, bool)
    split &= group_count(chart[cascade.singles >= MOST_SINGLES], n) == 0
    if not (again | split).any():
        return None
    with monitor.stage("repair layout"):
        few = LATE_SINGLE_FACES if late else SINGLE_FACES
        small = (size == 1) | ((size <= few) & (fault != DISTORTED))
        projected = tries >= PROJECTED_TRIES
        most = np.where(projected, PROJECTED_TRIES + LATE_HALVINGS, MOST_HALVINGS)
        single = split & (small | (tries >= most))
        project = split & ~single & ~projected & late
        halve = split & ~single & ~project
        if halve.any():
            shown = ", ".join(
                [str(int(k)) for k in size[halve][:4]] + ["..."] * int(halve.sum() > 4)
            )
            cut = atlas.cut | halve_charts(atlas, halve)
            cascade = replace(cascade, atlas=Atlas(atlas.surface, cut, atlas.corners)).repaired(
                f"{int(halve.sum())} chart(s) split, of {shown} faces: "
                f"{_causes(fault[halve])} in one piece"
            )
        if single.any():
            cascade = take_to_pieces(cascade, single[chart])
        if project.any():
            cascade = project_charts(cascade, project[chart])
        if again.any():
            cascade = cascade.repaired(
                f"{int(again.sum())} chart(s) mapped again: {_causes(fault[again])} at first"
            )
        step = np.where(project, PROJECTED_TRIES, bad.astype(np.int64))
        cascade = replace(cascade, tries=cascade.tries + step[chart])
        # halves of projected charts keep their coordinates
        todo = (again | halve)[chart] & (cascade.tries < PROJECTED_TRIES)
        gentle = cascade.tries >= CONVEX_HALVINGS
        cascade = _map_again(cascade, todo & ~gentle, "isometric", monitor)
        return _map_again(cascade, todo & gentle, "mean-value", monitor)


def _map_again(cascade: Cascade, faces: BoolArray, method: str, monitor: Monitor) -> Cascade:
    """Map the charts of some faces anew; where the method fails, they stay faulty and go on."""
    if not faces.any():
        return cascade
    atlas = Atlas(cascade.atlas.surface, cascade.atlas.cut, cascade.atlas.corners)
    cut_mesh, fid = atlas.surface.part_cut_mesh(atlas.cut, faces, atlas.charts()[1])
    options = MethodOptions(tolerance=cascade.rules.method.tolerance, max_iterations=PIECE_STEPS)
    try:
        layout = METHODS[method].function(cut_mesh, options, monitor)
        atlas.corners[fid] = layout.uv[cut_mesh.faces]
    except (NoResultError, TopologyError, np.linalg.LinAlgError, ArithmeticError):
        atlas.corners[fid] = np.nan
    return replace(cascade, atlas=atlas)


def halve_charts(atlas: Atlas, charts: BoolArray) -> BoolArray:
    """(e,) bool, new seams that halve charts ((n_charts,) bool): faces nearer to one of two far ends.

    Distances run over the dual graph (centroid to centroid); no seam runs along a locked edge, so polygons
    move as a whole. Pieces that fall apart become charts of their own.
    """
    surface, cut = atlas.surface, atlas.cut
    _, chart = atlas.charts()
    faces = np.flatnonzero(charts[chart])
    local = positions_in(len(chart), faces)
    e = np.flatnonzero(~cut & charts[chart[surface.edges[:, 0] // 3]])
    ends = local[surface.edges[e] // 3]
    centre = surface.points[surface.faces[faces]].mean(1)
    length = np.linalg.norm(centre[ends[:, 0]] - centre[ends[:, 1]], axis=1)
    floor = 1e-9 * float(length.mean()) if len(length) else 1.0
    weight = np.where(surface.locked[e], floor, np.maximum(length, floor))
    k = len(faces)
    graph = sps.coo_matrix((weight, (ends[:, 0], ends[:, 1])), shape=(k, k)).tocsr()
    label = chart[faces]
    first = first_of_groups(label)
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
    return first_of_groups(label, -np.where(np.isfinite(distance), distance, -1.0))


def _causes(codes: IntArray) -> str:
    words = {
        FLIPPED: "faces flipped",
        OVERLAPPING: "it overlapped itself",
        DISTORTED: "distorted too much",
    }
    parts = [word for code, word in words.items() if (codes == code).any()]
    return " or ".join(parts)


def take_to_pieces(cascade: Cascade, faces: BoolArray) -> Cascade:
    """Cut round every polygon among some faces, and project each onto its own plane.

    A triangle stays. The triangles of a polygon all agree with its normal (that is how polygons are
    triangulated), so none of them is flipped.
    """
    again = faces & (cascade.singles > 0)
    if again.any():
        cascade = _stand_in(cascade, again)
    faces = faces & ~again
    if not faces.any():
        return cascade
    surface = cascade.atlas.surface
    inside = faces[surface.edges // 3].any(1)
    cut = cascade.atlas.cut | (inside & ~surface.locked)
    _, polygon = surface.charts(~(inside & surface.locked & ~cut))
    fid = np.flatnonzero(faces)
    _, first, label = np.unique(polygon[fid], return_index=True, return_inverse=True)
    p = surface.points[surface.faces[fid]]
    normal = unit(group_sum(normals_of(p), label, len(first)))
    origin = p[first, 0]
    x = p[first, 1] - origin
    x = unit(x - (x * normal).sum(1)[:, None] * normal)
    basis = np.stack([x, np.cross(normal, x)], 1)[label]
    atlas = Atlas(surface, cut, cascade.atlas.corners)
    atlas.corners[fid] = np.einsum("mkc,mdc->mkd", p - origin[label][:, None], basis)
    return replace(cascade, atlas=atlas, singles=np.where(faces, 1, cascade.singles)).repaired(
        f"{len(fid)} face(s) placed one by one: no larger chart was valid"
    )


def _stand_in(cascade: Cascade, faces: BoolArray) -> Cascade:
    """Regular polygons for polygons so thin or small that stored numbers cannot hold their shape."""
    atlas = Atlas(cascade.atlas.surface, cascade.atlas.cut, cascade.atlas.corners)
    cut_mesh, fid = atlas.surface.part_cut_mesh(atlas.cut, faces, atlas.charts()[1])
    n, singles = cut_mesh.n_charts, cascade.singles.copy()
    longest = group_max(cut_mesh.edge_lengths.max(1), cut_mesh.chart, n)
    side = np.maximum(longest, STAND_IN * cascade.extent)
    old = np.linalg.norm(atlas.corners[fid, 1] - atlas.corners[fid, 0], axis=1)
    grown = group_max(np.where(singles[fid] >= 2, GROWTH_RATIO * old, 0.0), cut_mesh.chart, n)
    side = np.maximum(side, grown)
    # a polygon's triangles have all their corners on its boundary
    loops = cut_mesh.loops
    turn = ranges(np.diff(loops.start)) / np.diff(loops.start)[loops.loop_of]
    radius = side[loops.chart[loops.loop_of]] / np.sqrt(3)
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()[loops.half_edges]] = radius[:, None] * np.stack(
        [np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)], 1
    )
    atlas.corners[fid] = uv[cut_mesh.faces]
    singles[fid] = np.maximum(singles[fid] + 1, 2)
    return replace(cascade, atlas=atlas, singles=singles).repaired(
        f"{len(fid)} face(s) too thin or small to be stored got a regular polygon instead"
    )


def project_charts(cascade: Cascade, faces: BoolArray) -> Cascade:
    """Cut charts with those faces ((m,) bool) where the axis that faces look along most changes.

    Every face lies as seen along that axis from outside, so no face is flipped. Costs no solve; but parts of a
    chart may lie behind each other.
    """
    surface = cascade.atlas.surface
    look = _axes(surface)
    inside = faces[surface.edges // 3].any(1) & ~surface.locked
    differ = look[surface.edges[:, 0] // 3] != look[surface.edges[:, 1] // 3]
    atlas = Atlas(surface, cascade.atlas.cut | (inside & differ), cascade.atlas.corners)
    fid = np.flatnonzero(faces)
    p = surface.points[surface.faces[fid]]
    axis, back = look[fid] % 3, look[fid] >= 3
    u, v = (axis + 1) % 3, (axis + 2) % 3
    u, v = np.where(back, v, u), np.where(back, u, v)
    row = np.arange(len(fid))
    atlas.corners[fid] = np.stack([p[row, :, u], p[row, :, v]], 2)
    return replace(cascade, atlas=atlas).repaired(
        f"{len(fid)} face(s) projected along the axes: out of time for a map"
    )


def _axes(surface: Surface) -> IntArray:
    """(m,) the axis that each face is seen along: x, y, z, then the other way; alike in a polygon.

    The axis nearest to the normal comes first. Neighbours then vote among axes that are nearly as good.
    """
    p = surface.corners
    pairs = surface.edges // 3
    glue = pairs[surface.locked]
    n, polygon = components(len(p), glue[:, 0], glue[:, 1])
    normal = unit(group_sum(normals_of(p), polygon, n))
    seen = np.concatenate([normal, -normal], 1)
    look = seen.argmax(1)
    i, j = polygon[pairs[~surface.locked]].T
    weight = surface.edge_lengths[~surface.locked]
    own = OWN_VOTE_WEIGHT * (np.bincount(i, weight, n) + np.bincount(j, weight, n))
    each = np.arange(n)
    for _ in range(VOTE_ROUNDS):
        votes = np.bincount(6 * i + look[j], weight, 6 * n) + np.bincount(
            6 * j + look[i], weight, 6 * n
        )
        votes[6 * each + look] += own
        look = np.where(seen > STEEP_SHARE, votes.reshape(n, 6), seen - 2).argmax(1)
    return look[polygon]
