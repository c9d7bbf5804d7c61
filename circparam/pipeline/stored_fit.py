"""A packed layout whose numbers, as the format stores them, have no flip and no overlap, if that can be.

Slivers of rounding are faces that stay upright in stored numbers and lose most of their width. A face that is
100 storable numbers long and 3 wide may keep a thousandth of a cell. Its energy then exceeds that of all other
faces of its chart. Its vertices move to nearby storable numbers until the symmetric Dirichlet energy of their
faces, measured against the layout before rounding, is least.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from circparam.core.arrays import (
    cross2,
    cross_areas,
    dot2,
    group_count,
    group_sum,
    mask_of,
    next_half_edge,
    sorted_distinct,
    unit,
)
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import NoResultError
from circparam.formats.io import has_doubles
from circparam.geometry.boundary import boundary_in, turned_loops
from circparam.geometry.coverage import chart_boxes, pages_of
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import UVMap
from circparam.pipeline import fallback
from circparam.pipeline.align import align
from circparam.pipeline.density import of_charts
from circparam.pipeline.fallback import FLIPPED, OVERLAPPING, SOUND, Cascade, KnownPacking
from circparam.pipeline.job import Job
from circparam.pipeline.kept import put_into_room
from circparam.pipeline.options import Options
from circparam.pipeline.orient import up_axis, upright
from circparam.pipeline.pinned import place_pinned
from circparam.pipeline.place import Placed, chart_signs, pack_sorted, place, sized
from circparam.pipeline.representable_uv import (
    BOUNDARY_NUMBERS,
    RAY_NUMBERS,
    Patch,
    Rounding,
    Term,
    mend_faces,
    mixed,
    not_upright,
)

# share of the packing's work that is done again for a layout that stored numbers spoilt
RETRIED_EFFORT_SHARE = 0.1
ROWS_PAGE_SHARE = 0.4  # share of a page that charts in rows cover
# factor by which numbers are taken coarser if there is no time for a second packing
COARSER_FACTOR = 4.0
PACK_ROUNDS = 24  # of pack, store and check, before a layout that stored numbers spoil is given up
PUSH_ROUNDS = 2 * BOUNDARY_NUMBERS  # rounds in which boundaries that meet draw back
# of the mean energy of its chart: largest share that storing may add to a face. The least room below a
# bound is 5e-6
ENERGY_SHARE = 1e-6
MENDING_ROUNDS = 8  # in each of which every vertex of a sliver moves at most once


@dataclass(frozen=True, eq=False)
class Stored:
    """uv (nv, 2) storable; fault (n_charts,) as ``fallback.faults``; moved: vertices that are not where
    rounding alone puts them; double: in doubles (see ``WriteOptions.uv_double``)."""

    uv: FloatArray
    fault: IntArray
    moved: int = 0
    double: bool = False

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong with any chart."""
        return not (self.fault > 0).any()

    @property
    def notes(self) -> list[str]:
        """One line for each thing that was done for stored numbers."""
        moved = f"{self.moved} uv vertices moved to nearby storable numbers, because rounding "
        moved += "spoilt their faces"
        double = "uv are stored as doubles: single precision cannot represent some faces"
        return [moved] * (self.moved > 0) + [double] * self.double


@dataclass(frozen=True, eq=False)
class Fitted:
    """The layout of every face of the file, as stored, and the cascade that led to it; double: stored as
    doubles (see ``WriteOptions.uv_double``)."""

    cascade: Cascade
    uvmap: UVMap
    double: bool = False


def fit_stored(job: Job, cascade: Cascade, monitor: Monitor) -> Fitted:
    """Mend, scale and pack until the numbers as stored have no flip and no overlap; uv for every face.

    Packing takes longest, and faces that stored numbers cannot hold may need many steps of the cascade. After a
    spoilt layout, the next ones are tried at its size before they are packed. Raises NoResultError if no
    finite layout is found.
    """
    options, settled = job.options, False
    if monitor.hurried and options.packed and cascade.rules.may_split:
        # with time up, no packing is tried that stored numbers are likely to spoil: charts that are sound at
        # about the size of charts in rows on a full page, made coarser, are hardly ever spoilt
        size = float(np.sqrt(ROWS_PAGE_SHARE / cascade.atlas.surface.areas.sum())) / COARSER_FACTOR
        cascade, settled = _settle_stored(job, cascade, size, monitor), True
    for turn in range(PACK_ROUNDS):
        if turn == 1:  # faces that stored numbers spoil are spoilt in a loose layout too
            options = replace(options, effort=min(RETRIED_EFFORT_SHARE * options.work, 1.0))
        if not settled and cascade.packing is None:  # no layout is packed before it is settled
            cascade = fallback.settle(cascade, monitor)
        cut_mesh, uv = cascade.open()
        keep = cascade.kept_sizes(cut_mesh)
        with monitor.stage("pack"):
            sign = chart_signs(job.surface, cut_mesh, options)
            uv[:, 0] *= sign[cut_mesh.vertex_chart]
            placed = arrange(job, cut_mesh, uv, options, monitor, keep, cascade.packing)
        with monitor.stage("check"):
            turned = options.packed and options.turns != "none" and job.kept is None
            stored = stored_layout(job, cut_mesh, placed.uv, sign < 0, turned)
        uvmap = job.completed(cut_mesh, stored.uv, stored.double)
        cascade = cascade.noted(*placed.notes, *stored.notes)
        fitted = Fitted(cascade, uvmap, stored.double)
        if stored.sound:
            break
        after = fallback.advance(cascade, stored.fault, monitor)
        if after is None:
            break
        cascade = replace(after, packing=None)
        settled = options.packed and cascade.rules.may_split and not monitor.hurried
        if settled:
            at_size = sized(cut_mesh, placed.uv, keep)
            size = _length(cut_mesh, placed.uv) / _length(cut_mesh, at_size)
            cascade = _settle_stored(job, cascade, size, monitor)
    if not np.isfinite(fitted.uvmap.uv).all():
        raise NoResultError("no finite layout was found: try another --method, or --cut charts")
    return replace(fitted, cascade=cascade)


def arrange(
    job: Job,
    cut_mesh: CutMesh,
    uv: FloatArray,
    options: Options,
    monitor: Monitor,
    keep: BoolArray,
    known: KnownPacking | None = None,
) -> Placed:
    """Charts (nv, 2) where they lie: at their pins, in the room of a page in use, or packed.

    keep: (n_charts,) bool, charts that keep the size they have. known: see ``place``.
    """
    group, notes = None, []
    if job.tiles is not None:
        group = of_charts(job.tiles[job.surface.source], cut_mesh)[0].astype(np.int64)
    if options.pins is not None:
        placed = place_pinned(job, cut_mesh, uv, options.pins)
    else:
        if options.orient == "up":
            uv, note = upright(cut_mesh, job.surface, uv, up_axis(job.document, options))
            notes = [note]
        label = job.sorting(cut_mesh)
        if job.kept is not None:
            placed = put_into_room(job.kept, cut_mesh, sized(cut_mesh, uv, keep), options)
        elif label is None or job.groups is None:
            placed = place(cut_mesh, uv, options, monitor, group, keep, known)
        else:
            at_size, pages = sized(cut_mesh, uv, keep), job.groups.pages
            placed = pack_sorted(cut_mesh, at_size, options, monitor, label, pages)
    return Placed(align(cut_mesh, placed.uv, options, group), [*notes, *placed.notes])


def stored_layout(
    job: Job, cut_mesh: CutMesh, uv: FloatArray, mirrored: BoolArray, turn: bool = False
) -> Stored:
    """Round a packed layout (nv, 2) as the target stores it and mend spoilt faces; see ``store``.

    For charts that stay faulty, pages are turned by quarters (if ``turn``), because numbers are finest near
    zero. Next, uv become doubles where the format has them. The result has the fewest faulty charts.
    """
    tried: list[Stored] = []
    for double in (False, True) if has_doubles(job.format) else (False,):
        number = job.rounding(double)
        for exact in _placements(cut_mesh, uv, number, mirrored, turn and not double):
            tried.append(replace(store(cut_mesh, exact, mirrored, number), double=double))
            if tried[-1].sound:
                return tried[-1]
    return min(tried, key=lambda one: int((one.fault > 0).sum()))


def _placements(
    cut_mesh: CutMesh, uv: FloatArray, number: Rounding, mirrored: BoolArray, turn: bool
) -> Iterator[FloatArray]:
    """The layout itself, then the turn for which rounding spoils the fewest faces.

    All pages turn by the same quarters, counter-clockwise.
    """
    yield uv
    if turn:
        side = np.where(mirrored, -1, 1)[cut_mesh.chart]
        page = pages_of(cut_mesh, uv)[cut_mesh.vertex_chart]
        x, y, turns = uv[:, 0] - page, uv[:, 1], [uv]
        for _ in range(3):
            x, y = 1.0 - y, x
            turns.append(np.stack([x + page, y], 1))
        spoilt = [(side * signs(number(t), cut_mesh.faces) <= 0).sum() for t in turns]
        best = int(np.argmin(spoilt))
        if best:
            yield turns[best]


def _settle_stored(job: Job, cascade: Cascade, size: float, monitor: Monitor) -> Cascade:
    """Send charts on that stored numbers would spoil somewhere on a page, at a given size.

    Each lies turned, as packing may turn it, because needles along an axis would be stored too well; and at the
    far corner of the page, where stored numbers are coarsest.
    """
    cascade = fallback.settle(cascade, monitor)
    cut_mesh, uv = cascade.open()
    with monitor.stage("check"):
        uv = sized(cut_mesh, uv, cascade.kept_sizes(cut_mesh)) * size
        uv = uv @ np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
        uv = uv + (1.0 - chart_boxes(cut_mesh, uv)[1])[cut_mesh.vertex_chart]
        fault = stored_layout(job, cut_mesh, uv, np.zeros(cut_mesh.n_charts, bool)).fault
    settled = lambda part: _settle_stored(job, part, size, monitor)  # noqa: E731
    return fallback.settle_faulty(cascade, fault, monitor, settled)


def _length(cut_mesh: CutMesh, uv: FloatArray) -> float:
    p = uv[cut_mesh.faces]
    return max(float(np.linalg.norm(p[:, [1, 2, 0]] - p, axis=2).sum()), 1e-300)


def store(cut_mesh: CutMesh, exact: FloatArray, mirrored: BoolArray, rounding: Rounding) -> Stored:
    """Round a layout and mend spoilt faces.

    exact: (nv, 2) as placed, finite. mirrored: (n_charts,) charts that lie clockwise, as their file winds them.
    """
    patch = _patch(cut_mesh, exact, mirrored, rounding)
    uv, spoilt = mend_faces(patch)
    fault = np.where(group_count(cut_mesh.chart[spoilt], cut_mesh.n_charts) > 0, FLIPPED, SOUND)
    uv = relieve(patch, uv, cut_mesh.chart)
    # Charts whose boundaries meet draw back. They know nothing of each other here, so each round looks at those
    # alone that the last one moved.
    looked = fault == SOUND
    for push in range(1, PUSH_ROUNDS + 2):
        part, vertices, _ = cut_mesh.subset(looked)
        if not len(vertices):
            break
        found = overlaps(part, uv[vertices])
        fault[looked] = np.where(found.self_overlapping, OVERLAPPING, SOUND)
        meeting = sorted_distinct(found.crossings)
        if found.self_overlapping.any():  # holes narrower than a unit may have turned over
            b = boundary_in(part, uv[vertices])
            meeting = sorted_distinct(np.concatenate([meeting, b.half_edge[turned_loops(b)]]))
        if not len(meeting) or push > PUSH_ROUNDS:
            break
        alone = _patch(part, exact[vertices], mirrored[looked], rounding)
        uv[vertices] = _inwards(part, alone, uv[vertices], meeting, min(push, BOUNDARY_NUMBERS))
        again = mask_of(part.n_charts, part.chart[meeting // 3])
        looked[looked] = again
    return Stored(uv, fault, int((uv != patch.start).any(1).sum()))


def _patch(cut_mesh: CutMesh, exact: FloatArray, mirrored: BoolArray, rounding: Rounding) -> Patch:
    """All faces as they lie, counter-clockwise."""
    turned = mirrored[cut_mesh.chart][:, None]
    upright = np.where(turned, cut_mesh.faces[:, [0, 2, 1]], cut_mesh.faces)
    return Patch(upright, exact, cut_mesh.on_boundary, rounding)


def _inwards(cut_mesh: CutMesh, patch: Patch, uv: FloatArray, h: IntArray, by: int) -> FloatArray:
    """uv with the ends of boundary half-edges drawn towards the inside of their charts, by so many numbers.

    A vertex takes the best place of its window that leaves all its faces upright.
    """
    flat = cut_mesh.faces.ravel()
    a, b = flat[h], flat[next_half_edge(h)]
    # the inside is where the third corner of the half-edge's face lies
    inside, along = np.zeros_like(uv), uv[b] - uv[a]
    third = uv[flat[next_half_edge(next_half_edge(h))]]
    normal = np.stack([-along[:, 1], along[:, 0]], 1)
    normal *= np.sign(((third - uv[a]) * normal).sum(1))[:, None]
    normal = unit(normal)
    np.add.at(inside, a, normal)
    np.add.at(inside, b, normal)
    inside = unit(inside)
    turned_over: Term = lambda own, around, triangles: not_upright(triangles).astype(float)  # noqa: E731
    uv, waiting = uv.copy(), np.zeros(len(uv), bool)
    waiting[a] = waiting[b] = True
    for chosen in patch.in_turns(waiting, np.arange(len(uv))):
        grid, step = patch.places(uv, chosen)
        away = (grid - patch.start[chosen][:, None]) / step[:, None]
        cost: FloatArray = ((away - by * inside[chosen][:, None]) ** 2).sum(2)
        stay = grid.shape[1] // 2  # always possible
        here = np.minimum(cost[:, stay], 1e9)
        cost[np.abs(away).max(2) > BOUNDARY_NUMBERS] = np.inf
        cost[patch.total(uv, chosen, grid, turned_over) > 0] = np.inf
        cost[:, stay] = here
        uv[chosen] = grid[np.arange(len(chosen)), cost.argmin(1)]
    return uv


def relieve(patch: Patch, stored: FloatArray, chart: IntArray) -> FloatArray:
    """(n, 2) stored places, with the vertices of slivers moved to where those have more of their shape.

    chart: (m,) chart of each face. No face is flipped that was not.
    """
    faces, exact = patch.faces, patch.exact
    load = _loads(exact[faces], stored[faces])
    area = np.abs(cross_areas(exact[faces]))
    most = ENERGY_SHARE * group_sum(area, chart, int(chart.max()) + 1)[chart]
    sliver = (load > most) & np.isfinite(load)
    if not sliver.any():
        return stored
    free = mask_of(len(exact), faces[sliver])
    part, near, v = patch.part(free)
    at, limit = stored[v], np.where(part.on_boundary, BOUNDARY_NUMBERS, RAY_NUMBERS[-1])

    def energy(own: IntArray, around: IntArray, triangles: FloatArray) -> FloatArray:
        """(c, w) load of the faces round vertices at each of their places."""
        load = _loads(part.exact[around][:, None], triangles)
        load[not_upright(triangles)] = np.inf
        return load

    for turn in range(MENDING_ROUNDS):
        load = _loads(part.exact[part.faces], at[part.faces])
        active = mask_of(len(v), part.faces[(load > most[near]) & np.isfinite(load)])
        active &= free[v]
        if not active.any():
            break
        # inner vertices move freely
        waiting = active & ~part.on_boundary if turn % 2 == 0 else active
        for chosen in part.in_turns(waiting, mixed(np.arange(len(v)), turn)):
            along, step = part.rays(at, chosen)
            grid = np.concatenate([at[chosen][:, None], part.places(at, chosen)[0], along], 1)
            cost = part.total(at, chosen, grid, energy)
            away = np.abs(grid - part.start[chosen][:, None]) / step[:, None]
            far = away.max(2) > limit[chosen][:, None]
            far[:, 0] = False
            cost[far] = np.inf
            at[chosen] = grid[np.arange(len(chosen)), cost.argmin(1)]
    out = stored.copy()
    out[v] = at
    return out


def _loads(before: FloatArray, after: FloatArray) -> FloatArray:
    """(...) twice the area of triangles (..., 3, 2) times their energy above an isometry.

    Infinite if one of them is not counter-clockwise.
    """
    a, b, c, d = (t[..., k, :] - t[..., 0, :] for t in (before, after) for k in (1, 2))
    was, now = cross2(a, b), cross2(c, d)
    with np.errstate(all="ignore"):
        square = dot2(b, b) * dot2(c, c) + dot2(a, a) * dot2(d, d)
        square = (square - 2 * dot2(a, b) * dot2(c, d)) / (was * was)
        load = was * (square * (1 + (was / now) ** 2) / 4 - 1)
    return np.where((was > 0) & (now > 0) & np.isfinite(load), load, np.inf)
