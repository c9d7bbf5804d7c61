"""Seams decided on one surface."""

from dataclasses import replace

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.surface import Surface
from circparam.seams.cost import COST
from circparam.seams.moves.glue import MergeOptions
from circparam.seams.options import Search
from circparam.seams.segmentation import decide, starts
from circparam.seams.segmentation.layout import judge
from tests.support import shapes
from tests.support.atlases import surface_of, uncut

MERGING = MergeOptions(1.05, margin=0.004)


def bumpy() -> Surface:
    points, faces = shapes.icosphere(3)
    return surface_of(points * (1 + 0.3 * np.sin(3 * points[:, :1])), faces)


@pytest.mark.parametrize("draw", range(3))
def test_each_search_ends_in_charts_below_the_bound(draw: int) -> None:
    """The cheapest of its starts."""
    surface, merging = bumpy(), replace(MERGING, search=Search(draw=draw))
    regions = [k for _, k in starts.starts_of(merging.search, surface)]
    atlas = starts.searched(surface, merging, regions, Worker(1), Monitor())
    assert not judge(*atlas.open()).bad(MERGING.bound).any()
    each = [starts.grow_and_merge(surface, merging, k, None, Monitor()) for k in regions]
    assert COST.seams(atlas) == min(COST.seams(one) for one in each)


def test_a_component_stays_whole_where_it_is_a_good_chart() -> None:
    """A ball with a pinhole needs a seam; a cap of it needs none."""
    points, faces = shapes.icosphere(4)
    height = points[faces][:, :, 2].max(1)
    cap, ball = uncut(points, faces[height > 0.7]), uncut(points, faces[height > -0.95])
    assert decide.whole_components(cap, 1.05).all()
    assert not decide.whole_components(ball, 1.05).any()
