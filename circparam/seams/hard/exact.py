"""Boxes and other polyhedra: a net without any distortion, where its seams are hardly longer."""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, group_sum
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import UNROLLED
from circparam.seams.cost import COST
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.solvers.objective import chart_energies


def polyhedra(atlas: Atlas) -> BoolArray:
    """(m,) bool: faces of components that consist of flats between creases, and of nothing else.

    The atlas has the prices of hard surfaces.
    """
    surface, prices = atlas.surface, atlas.prices
    if prices is None:
        return np.zeros(len(surface.faces), bool)
    round_here = np.zeros(len(surface.faces), bool)
    round_here[surface.edges[~prices.flat & ~prices.crease, 0] // 3] = True
    return ~surface.whole_components(round_here)


def prefer_exact(
    atlas: Atlas, start: Atlas, options: MergeOptions, worker: Worker, monitor: Monitor
) -> None:
    """Take the exact net of polyhedra whose charts are distorted, where that is worth its longer seams.

    start: the atlas when each flat was a chart of its own, laid out as it is. options: of the merging that led
    from there to ``atlas``.
    """
    which = polyhedra(atlas)
    which &= (_distortion(atlas) > UNROLLED)[atlas.surface.components[1]]
    if not which.any() or monitor.expired:
        return
    mine, exact = atlas.part(which), start.part(which)
    within = MergeOptions(UNROLLED, options.margin, work=options.work)
    merge(exact, within, monitor, worker=worker)
    exact_cost, cost = (COST.of_components(one, relaxed=True) for one in (exact, mine))
    better = (exact_cost < cost) & (_distortion(exact) <= UNROLLED)
    taken = better[exact.surface.components[1]]
    if taken.any():
        mine.put(taken, exact.part(taken))
        atlas.put(which, mine)


def _distortion(atlas: Atlas) -> FloatArray:
    """(components,) mean of the energies of the charts, by area."""
    n, component = atlas.surface.components
    cut_mesh, uv = atlas.open()
    energy = chart_energies(cut_mesh, uv)[cut_mesh.chart]
    areas = atlas.surface.areas
    total = np.maximum(group_sum(areas, component, n), 1e-300)
    return np.asarray(group_sum(energy * areas, component, n) / total)
