"""Boxes and other polyhedra: a net without any distortion, where its seams are hardly longer."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, group_sum
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.seams.cost import COST
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.objective import chart_energies

EXACT = 1 + 1e-5  # distortion up to which a layout counts as an unfolding


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
    which &= (_distortion(atlas) > EXACT)[atlas.surface.components[1]]
    if not which.any() or monitor.expired:
        return
    mine, exact = atlas.part(which), start.part(which)
    within = MergeOptions(EXACT, margin=options.margin, rigid=True, work=options.work)
    Merger(exact, within, np.zeros(len(exact.cut), bool), worker).run(monitor)
    better = (_cost(exact) < _cost(mine)) & (_distortion(exact) <= EXACT)
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


def _cost(atlas: Atlas) -> FloatArray:
    """(components,) length of the seams, charts and distortion, in roots of the area of the component."""
    surface = atlas.surface
    n, component = surface.components
    root = np.sqrt(np.maximum(group_sum(surface.areas, component, n), 1e-300))
    of = component[surface.edges[atlas.cut, 0] // 3]
    seam = group_sum(surface.edge_lengths[atlas.cut], of, n) / root
    _, first = np.unique(atlas.charts()[1], return_index=True)
    charts = np.bincount(component[first], minlength=n)
    return np.asarray(seam + COST.chart * charts + COST.distortion * (_distortion(atlas) - 1))
