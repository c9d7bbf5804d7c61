"""A fuller page for a little seam: what ``--pack-splits auto`` does.

Texels are bought with seam. A page of R · R texels of which a share s is covered has s R² texels of surface,
and seams and boundaries of length L, in roots of the area, have L √s R texels beside them, where filters blend
and mip maps bleed. **A cut is worth it where texels grow by a larger percentage than seams do** (``RATE`` in
``cut_plan``): every place of the surface has so many more texels, and the share of them that lie at a seam,
L / √s, grows by half that percentage at most. A mesh that needs no seam gets none, and all cuts together make
the seams no longer than ``MOST`` allows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.words import counted
from circparam.geometry.distortion import best_chart_scales
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.packing.options import PackOptions
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.cut_along import Chord, cut_along
from circparam.pipeline.cut_plan import Plan, Planner, sketch_of
from circparam.seams.hard.flats import DEAR, hard_prices, real_flats
from circparam.seams.hard.regions import HARD, hardness, seam_prices

MOST = 0.135  # of the length of the seams that all cuts may add, as planned
LIMIT = 0.149  # and as they run along the edges of the mesh
CUTS = 6  # at most
THROUGH_FLATS = 0.2  # of the length of a cut that may run through flats


def fill_page(
    cascade: Cascade, most: int | None, least_faces: int, options: PackOptions, monitor: Monitor
) -> Cascade:
    """Cut charts where a page so much fuller is worth the seam; a note tells what was done.

    most: charts that there may be, None for any number. least_faces: of either part of a chart that is cut.
    Charts keep the layout they had, so nothing overlaps, and their bound.
    """
    cascade = fallback.settle(cascade, monitor)
    before = cascade.atlas
    cut_mesh, uv = before.open()
    cuts = CUTS if most is None else min(CUTS, most - cut_mesh.n_charts)
    seams = before.seam_length * float(np.sqrt(before.surface.areas.sum()))
    if cuts < 1 or seams <= 0 or monitor.expired or not np.isfinite(uv).all():
        return cascade

    def stop() -> bool:
        return monitor.expired

    scale = best_chart_scales(cut_mesh, uv)[cut_mesh.vertex_chart][:, None]
    made = sketch_of(cut_mesh, uv * scale, options, stop)
    if made is None:
        return cascade
    first, easel = made
    area = float(cut_mesh.chart_areas.sum())
    plan = Planner(easel, area, first.length + MOST * seams, cuts, stop).best(first)
    if not plan.cuts:
        return cascade
    after, done = _cut(before, cut_mesh, uv, plan, (cascade.rules.bound, least_faces))
    if done == 0 or (done < len(plan.cuts) and not _pays(after, first, options, monitor)):
        return cascade
    longer = after.seam_length / before.seam_length - 1
    return replace(cascade, atlas=after).noted(
        f"{counted(done, 'cut')} for a fuller page made the seams {longer:.1%} longer "
        "(--pack-splits 0 makes none)"
    )


def _cut(
    before: Atlas, cut_mesh: CutMesh, uv: FloatArray, plan: Plan, held: tuple[float, int]
) -> tuple[Atlas, int]:
    """(the atlas with those cuts of a plan that can be made along edges, how many these are).

    held: the bound on the distortion of either part, and the least number of its faces.
    """
    faces = np.isin(cut_mesh.chart, [cut.chart for cut in plan.cuts])
    part = before.part(faces)  # the charts that are cut, alone: others take no time
    left = LIMIT * float(before.surface.edge_lengths[before.cut].sum())
    costs, flat = _costs(part.surface)
    done = 0
    for cut in plan.cuts:
        mine = cut_mesh.chart[faces] == cut.chart
        chord = Chord(mine, uv[cut.start], uv[cut.end], cut.least)
        tried = cut_along(part, chord, costs, *held)
        if tried is None:
            continue
        new = tried.cut & ~part.cut
        length = float(part.surface.edge_lengths[new].sum())
        through = float(part.surface.edge_lengths[new & flat].sum())
        if length <= left and through <= THROUGH_FLATS * length:
            part, left, done = tried, left - length, done + 1
    after = Atlas(before.surface, before.cut, before.corners, before.prices)
    after.put(faces, part)
    return after, done


def _costs(surface: Surface) -> tuple[FloatArray, BoolArray]:
    """((e,) what a cut along each edge costs, (e,) bool: edges inside flats that are meant)."""
    cost = np.where(surface.locked, np.inf, surface.priced_lengths)
    flat, size = real_flats(surface)
    flat = flat & (size > 2)
    hard = hardness(surface) == HARD
    if hard.any():
        prices = hard_prices(surface, [(hard, seam_prices(surface.part(hard)))])
        return cost * prices.price, flat | prices.flat
    return cost * np.where(flat, DEAR, 1.0), flat


def _pays(after: Atlas, first: Plan, options: PackOptions, monitor: Monitor) -> bool:
    """Whether some cuts of a plan are worth it without the others."""
    cut_mesh, uv = after.open()
    scale = best_chart_scales(cut_mesh, uv)[cut_mesh.vertex_chart][:, None]
    made = sketch_of(cut_mesh, uv * scale, options, lambda: monitor.expired)
    return made is not None and made[0].value > first.value
