"""What is asked of the seams when nothing is said, and what a way of cutting gives at least."""

import numpy as np

from circparam.core.monitor import Monitor
from circparam.seams.constraints import constrain
from circparam.seams.moves.glue import MergeOptions
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.small import absorb
from tests.support import shapes
from tests.support.atlases import cut_between, middles, surface_of


def test_without_options_no_edge_is_forced_or_forbidden_and_no_chart_is_too_small() -> None:
    surface = surface_of(*shapes.cube(1))
    closed, forced, notes = constrain(surface, SeamOptions())
    assert not forced.any()
    assert not closed.locked.any()
    assert notes == []
    single = cut_between(surface, np.arange(len(surface.faces)))
    least = SeamOptions().min_chart_faces
    assert (
        absorb(single, MergeOptions(SeamOptions().max_distortion, chart=np.inf), least, Monitor())
        == 0
    )
    assert single.cut.all()
    assert SeamOptions().max_charts is None


def test_groups_alone_are_no_seams() -> None:
    surface = surface_of(*shapes.grid(3, 3))
    groups = (middles(surface)[:, 0] > 0.5).astype(np.int64)
    assert not constrain(surface, SeamOptions(groups=groups))[1].any()
