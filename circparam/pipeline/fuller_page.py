"""A fuller page for a little seam: what ``--pack-splits auto`` does.

Texels are bought with seam. A page of R · R texels of which a share s is covered has s R² texels of surface,
and seams and boundaries of length L, in roots of the area, have L √s R texels beside them, where filters blend
and mip maps bleed. **A cut is worth it where texels grow by half the percentage by which seams do, at least**
(``RATE`` in ``cut_plan``), as sketches of the page see it. They see it in steps of a cell, 4 % of what is
covered, and so late. Cuts that were made so brought 4.4 % more texels for each percent of seam (21 meshes).
A mesh that needs no seam gets none, and all cuts together make the seams no longer than ``LIMIT`` allows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.words import counted
from circparam.packing.options import PackOptions
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.cut_along import Limits
from circparam.pipeline.cut_plan import Planner, easel_of, first_plan
from circparam.pipeline.pieces import Carver

LIMIT = 0.149  # of the length of the seams that all cuts may add
CUTS = 8  # at most


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

    easel = easel_of(cut_mesh, options)
    carver = Carver(before, cut_mesh, uv, easel, Limits(cascade.rules.bound, least_faces))
    first = first_plan(carver, stop)
    if first is None:
        return cascade
    area = float(cut_mesh.chart_areas.sum())
    plan = Planner(carver, area, first.length + LIMIT * seams, cuts, stop).best(first)
    if not plan.cuts:
        return cascade
    after = carver.joined(plan.pieces)
    longer = after.seam_length / before.seam_length - 1
    return replace(cascade, atlas=after).noted(
        f"{counted(plan.cuts, 'cut')} for a fuller page made the seams {longer:.1%} longer "
        "(--pack-splits 0 makes none)"
    )
