"""Lay charts out anew after their seams have moved, from the layout they had."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import group_count, group_sum, mask_of
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.core.workers import in_parts, in_processes
from circparam.geometry.overlap import self_overlapping
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.accuracy import TRIAL
from circparam.solvers import dirichlet
from circparam.solvers.newton import BAD_START, RelaxOptions, relax
from circparam.solvers.objective import Objective, chart_energies, in_units_of_faces
from circparam.solvers.preconditioner import DIRECT_LIMIT, SMALL_CHART
from circparam.solvers.region import cut_out, grow
from circparam.solvers.separate import push_apart
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.untangle import FEW_FLIPS_RINGS, untangle


@dataclass(frozen=True, eq=False)
class ChartLayouts:
    """A layout of all charts. energy: (n,); overlapping: (n,) bool."""

    cut_mesh: CutMesh
    uv: FloatArray
    energy: FloatArray
    overlapping: BoolArray

    def bad(self, bound: float) -> BoolArray:
        """(n,) charts above the bound, flipped, or overlapping themselves."""
        return ~(self.energy <= bound) | self.overlapping

    def bad_faces(self, bound: float) -> BoolArray:
        """(m,) bool: faces of such charts."""
        return self.bad(bound)[self.cut_mesh.chart]


def lay_out_fresh(
    atlas: Atlas,
    which: BoolArray | None,
    options: RelaxOptions,
    monitor: Monitor | None = None,
) -> ChartLayouts:
    """Embed charts on circles and relax them; ``which`` ((n,) bool): the others keep their layout.

    monitor: its processes share many charts out in parts; None lays all out together.
    """
    cut_mesh, uv = atlas.open()
    chosen = np.ones(cut_mesh.n_charts, bool) if which is None else which
    if chosen.any():
        sub, vid, fid = cut_mesh.subset(chosen)
        if monitor is None:
            part = embed_and_relax(sub, options, None)
        else:
            part = np.zeros((sub.n_vertices, 2))
            parts = chart_parts(sub)
            tasks = [(part_mesh, options) for _, part_mesh, _, _ in parts]
            done = in_processes(embed_and_relax, tasks, monitor)
            for (_, _, of_part, _), result in zip(parts, done, strict=True):
                part[of_part] = result
        uv[vid] = part
        atlas.corners[fid] = part[sub.faces]
    return judge(cut_mesh, uv)


def chart_parts(cut_mesh: CutMesh) -> list[tuple[BoolArray, CutMesh, IntArray, IntArray]]:
    """CutMesh as ``in_parts`` has them: [((n,) charts, cut mesh of those, vertices, faces)]."""
    shares = in_parts(cut_mesh.chart)
    if len(shares) == 1:
        whole = np.ones(cut_mesh.n_charts, bool)
        return [(whole, cut_mesh, np.arange(cut_mesh.n_vertices), np.arange(len(cut_mesh.faces)))]
    charts = [mask_of(cut_mesh.n_charts, cut_mesh.chart[faces]) for faces in shares]
    return [(part, *cut_mesh.subset(part)) for part in charts]


def embed_and_relax(
    cut_mesh: CutMesh, options: RelaxOptions, monitor: Monitor | None
) -> FloatArray:
    """(nv, 2) mean-value map of every chart onto a circle, relaxed."""
    start, _ = tutte_embedding(cut_mesh, "mean-value")
    return relax(cut_mesh, start, options).uv


def judge(cut_mesh: CutMesh, uv: FloatArray) -> ChartLayouts:
    """Energies and overlaps of a layout."""
    energy = chart_energies(cut_mesh, uv)
    overlapping = ~np.isfinite(energy)
    fine = ~overlapping
    if fine.any():
        sub, vid, _ = cut_mesh.subset(fine)
        overlapping[fine] = self_overlapping(sub, uv[vid])
    return ChartLayouts(cut_mesh, uv, energy, overlapping)


def lay_out_sound(
    cut_mesh: CutMesh, uv: FloatArray, options: RelaxOptions, monitor: Monitor
) -> FloatArray:
    """Relax a layout; charts with flipped faces are untangled, or else embedded anew, first."""
    parts = chart_parts(cut_mesh)
    out = np.zeros_like(uv)
    tasks = [(part, uv[vid], options) for _, part, vid, _ in parts]
    done = in_processes(lay_out_part, tasks, monitor)
    for (_, _, vid, _), of_part in zip(parts, done, strict=True):
        out[vid] = of_part
    return out


def pushed_apart(
    cut_mesh: CutMesh, uv: FloatArray, bound: float, monitor: Monitor
) -> tuple[FloatArray, BoolArray]:
    """As ``push_apart`` without a margin: of a rough chart some parts come nearer than any. Many faces in
    parts, by all processes."""
    parts = chart_parts(cut_mesh)
    tasks = [(part, uv[vid], 0.0, bound) for _, part, vid, _ in parts]
    done = in_processes(push_apart, tasks, monitor)
    out, fine = np.zeros_like(uv), np.zeros(cut_mesh.n_charts, bool)
    for (which, _, vid, _), (moved, good) in zip(parts, done, strict=True):
        out[vid], fine[which] = moved, good
    return out, fine


def lay_out_part(
    cut_mesh: CutMesh, uv: FloatArray, options: RelaxOptions, monitor: Monitor
) -> FloatArray:
    """As ``lay_out_sound``, of the charts that are worked on together."""
    alone = np.flatnonzero((np.bincount(cut_mesh.chart) == 1)[cut_mesh.chart])
    if len(alone):  # a single face lies as it is
        uv = uv.copy()
        uv[cut_mesh.faces[alone]] = cut_mesh.rest_triangles[alone]
    bad = ~np.isfinite(chart_energies(cut_mesh, uv))
    # to untangle a small chart takes longer than to relax it from a circle
    small = group_count(cut_mesh.vertex_chart, cut_mesh.n_charts) <= SMALL_CHART
    lost = group_count(cut_mesh.vertex_chart[~np.isfinite(uv).all(1)], cut_mesh.n_charts) > 0
    fresh = bad & (small | lost)
    bad &= ~fresh
    if fresh.any():
        uv = uv.copy()
        sub, vid, _ = cut_mesh.subset(fresh)
        uv[vid] = tutte_embedding(sub, "mean-value")[0]
    if bad.any():
        uv = uv.copy()
        sub, vid, _ = cut_mesh.subset(bad)
        near = options.local is not None
        part, report = untangle(sub, uv[vid], monitor=monitor, near=near)
        uv[vid] = part
        left = report.after > 0
        if left.any() and not near:
            rest, inner, _ = sub.subset(left)
            uv[vid[inner]] = tutte_embedding(rest, "mean-value")[0]
    # whole steps of systems that are factored take no longer
    if options.local is not None and cut_mesh.n_vertices > DIRECT_LIMIT:
        uv = eased(cut_mesh, uv, options.local)
    return relax(cut_mesh, uv, options, monitor).uv


def eased(cut_mesh: CutMesh, uv: FloatArray, local: int) -> FloatArray:
    """The layout with the worst faces of some charts relaxed beside what is near; all other vertices stay.

    A few faces that nearly collapsed may hold most of the excess of a chart that was carried from another
    surface. Newton's model foresees a third of what they gain: whole charts would take a step for each third.
    Charts where such faces hold less stay as they are. local: as ``RelaxOptions`` has it.
    """
    work, scaled, _ = in_units_of_faces(cut_mesh, uv)
    objective = Objective(work, None, 0.0)
    energy, jacobian = objective.energies(scaled)
    of_face = dirichlet.energy(jacobian, 0.0)
    worst = (of_face > BAD_START) & np.isfinite(energy)[work.chart]
    held = group_sum((objective.weight * of_face)[worst], work.chart[worst], work.n_charts)
    worst &= (held > (energy - 1) / 2)[work.chart]
    if not worst.any():
        return uv
    region = grow(cut_mesh, worst, FEW_FLIPS_RINGS[0])
    part, source, fixed = cut_out(cut_mesh, region, np.zeros(len(uv), bool))
    moved = relax(part, uv[source], replace(TRIAL, fixed=fixed, local=local)).uv
    out = uv.copy()
    out[source[~fixed]] = moved[~fixed]
    return out
