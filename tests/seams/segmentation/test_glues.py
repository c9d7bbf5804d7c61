"""Merging where unions may add hardly any energy: room, and what is tried again where there is more."""

import numpy as np

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.newton import RelaxOptions
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import cut_between, middles, surface_of

STEPS = RelaxOptions(tolerance=1e-6, max_iterations=60)


def sheet_and_ball() -> Atlas:
    """A flat sheet in four pieces, which cost nothing to be merged, and a ball in eight, which do."""
    sheet, ball = shapes.grid(12, 12), shapes.icosphere(3)
    surface = surface_of(*shapes.join(sheet, (ball[0] + [5, 0, 0], ball[1])))
    middle = middles(surface)
    flat = np.abs(middle[:, 2]) < 1e-12
    flat[len(sheet[1]) :] = False
    octant = (middle > [5, 0, 0]) @ [1, 2, 4]
    quarter = (middle[:, :2] > 0.45) @ [1, 2]
    atlas = cut_between(surface, np.where(flat, quarter, 10 + octant))
    lay_out_fresh(atlas, None, STEPS)
    assert atlas.charts()[0] == 12
    return atlas


def energy_of(atlas: Atlas) -> float:
    """Energy times area of all charts."""
    cut_mesh, uv = atlas.open()
    return float(chart_energies(cut_mesh, uv) @ cut_mesh.chart_areas)


def test_room_bounds_what_all_unions_add_together() -> None:
    """The pieces of the sheet merge at no cost, those of the ball do not."""
    atlas = sheet_and_ball()
    most = (1 + 1e-6) * energy_of(atlas)
    Merger(atlas, MergeOptions(1.2, rise=1e-6), np.zeros(len(atlas.cut), bool)).run(Monitor())
    assert energy_of(atlas) <= most
    assert atlas.charts()[0] == 9
