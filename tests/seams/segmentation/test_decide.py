"""Seams decided on one surface."""

from dataclasses import replace

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.cost import COST
from circparam.seams.options import Search
from circparam.seams.segmentation import decide as module
from circparam.seams.segmentation import starts
from circparam.seams.segmentation.layout import judge, lay_out_fresh
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import cut_between, middles, surface_of

MERGING = MergeOptions(1.05, margin=0.004)


def bumpy() -> Surface:
    points, faces = shapes.icosphere(3)
    return surface_of(points * (1 + 0.3 * np.sin(3 * points[:, :1])), faces)


@pytest.mark.parametrize("draw", range(3))
def test_each_search_ends_in_charts_below_the_bound(draw: int) -> None:
    """The cheapest of its starts."""
    surface, merging = bumpy(), replace(MERGING, search=Search(draw=draw))
    atlas = starts.searched(surface, merging, Worker(1), Monitor())
    assert not judge(*atlas.open()).bad(MERGING.bound).any()
    each = [
        starts.grow_and_merge(surface, merging, k, None, Monitor())
        for k in starts.seeds_of(merging.search, surface)
    ]
    assert COST.seams(atlas) == min(COST.seams(one) for one in each)


def test_searches_differ_by_their_draw() -> None:
    cuts = [
        starts.searched(
            bumpy(), replace(MERGING, search=Search(draw=k)), Worker(1), Monitor()
        ).cut.tobytes()
        for k in (0, 0, 1)
    ]
    assert cuts[0] == cuts[1] != cuts[2]


def bumped_ring(height: float) -> tuple[np.ndarray, np.ndarray]:
    """A sheet with a hole in its right half and a hill in its left one."""
    points, faces = shapes.grid(61, 45)
    middle = points[faces].mean(1)
    hole = (np.abs(middle[:, 0] - 0.7) < 0.1) & (np.abs(middle[:, 1] - 0.5) < 0.2)
    used, index = np.unique(faces[~hole], return_inverse=True)
    points = points[used]
    far = (points[:, :2] - [0.1, 0.5]) ** 2
    points[:, 2] = height * np.exp(-far.sum(1) / (2 * 0.15**2))
    return points, index.reshape(-1, 3)


@pytest.mark.parametrize("stretch", [1.0, 1.1])
def test_charts_of_a_proxy_merge_as_if_they_were_relaxed(stretch: float) -> None:
    """A layout that is no minimum must neither hide what fits nor, when it is one, pay for what does not."""
    surface = surface_of(*bumped_ring(0.3))
    halves = cut_between(surface, (middles(surface)[:, 1] > 0.5).astype(np.int64))
    laid = lay_out_fresh(halves, None, RelaxOptions(tolerance=1e-8, max_iterations=60))
    area, least = laid.cut_mesh.chart_areas, laid.energy
    rough = Atlas(surface, halves.cut, halves.corners * [stretch, 1 / stretch])
    was = judge(*rough.open()).energy
    given = rough.corners.copy()
    out = module.merged_on(rough, 1.05, Monitor())
    np.testing.assert_array_equal(rough.corners, given)
    after = judge(*out.open())
    mean = np.average(after.energy, weights=after.cut_mesh.chart_areas)
    assert not after.bad(1.05).any()
    assert mean <= (1 + module.RISE) * np.average(was, weights=area)
    assert out.seam_length <= rough.seam_length
    # what is saved by relaxing pays for one chart, which costs three times as much as may be added
    assert mean <= (1 + 4 * module.RISE) * np.average(least, weights=area)
    assert out.charts()[0] == (2 if stretch == 1 else 1)


def test_one_piece_is_left_alone() -> None:
    surface = surface_of(*bumped_ring(0.3))
    whole = Atlas(surface, np.zeros(len(surface.edges), bool))
    assert module.merged_on(whole, 1.05, Monitor()) is whole
