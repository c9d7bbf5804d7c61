"""Regions that leave their chart for one along which their seam is longer."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.cost import COST
from circparam.seams.evaluate import Demands
from circparam.seams.hard.charts import MARGIN, merge_regions
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.moves.hand_over import HandOver
from circparam.seams.search import Effort, search
from circparam.seams.segmentation.layout import judge, lay_out_fresh
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import (
    as_it_lies,
    assert_promises,
    cut_between,
    energies,
    middles,
    surface_of,
    voronoi,
)

BOUND = 1.05


def tab(depth: float, width: float) -> tuple[Atlas, np.ndarray]:
    """(a sheet of two charts, region of each face): a tab of the right half reaches into the left one."""
    surface = surface_of(*shapes.grid(9, 9))
    x, y = middles(surface)[:, :2].T
    right = x > 0.5
    reaches = ~right & (x > 0.5 - depth) & (np.abs(y - 0.5) < width / 2)
    atlas = as_it_lies(cut_between(surface, (right | reaches).astype(np.int64)))
    return atlas, np.where(reaches, 2, right.astype(np.int64))


def hand_over(atlas: Atlas, region: np.ndarray) -> None:
    search(atlas, HandOver(region), Demands(BOUND), Effort(), Monitor())


@pytest.mark.parametrize(("depth", "width"), [(0.25, 0.25), (0.125, 0.5), (0.375, 0.25)])
def test_a_tab_leaves_its_chart_where_the_seam_gets_shorter(depth: float, width: float) -> None:
    atlas, region = tab(depth, width)
    assert atlas.seam_length == pytest.approx(1 + 2 * depth)
    hand_over(atlas, region)
    assert atlas.charts()[0] == 2
    assert atlas.seam_length == pytest.approx(1)
    assert_promises(atlas, 1 + 1e-9)


def test_a_region_stays_where_its_seam_would_not_get_shorter() -> None:
    """The tab is cut off where it is widest: it has no more seam with the left half than with its own chart."""
    surface = surface_of(*shapes.grid(9, 9))
    x = middles(surface)[:, 0]
    atlas = as_it_lies(cut_between(surface, (x > 0.5).astype(np.int64)))
    before = atlas.cut.copy()
    hand_over(atlas, np.digitize(x, [0.25, 0.5, 0.75]))
    assert np.array_equal(atlas.cut, before)


def test_a_chart_is_never_handed_over_in_pieces_nor_as_a_whole() -> None:
    """Without its middle strip the right half would be two charts; as one region it would be glued."""
    atlas, region = tab(0.25, 0.25)
    x, y = middles(atlas.surface)[:, :2].T
    across = np.where((x > 0.5) & (np.abs(y - 0.5) < 0.125), 2, region)
    before = atlas.cut.copy()
    hand_over(atlas, across)
    assert np.array_equal(atlas.cut, before)
    hand_over(atlas, (region > 0).astype(np.int64))
    assert np.array_equal(atlas.cut, before)


def test_what_was_tried_in_vain_is_not_tried_again() -> None:
    """A ball in two caps and a band, split in the middle: no half cap unrolls with what is beside it."""
    surface = surface_of(*shapes.icosphere(3))
    z = middles(surface)[:, 2]
    atlas = cut_between(surface, (z > 0.2).astype(np.int64))
    lay_out_fresh(atlas, None, RelaxOptions())
    family = HandOver(np.digitize(z, [-0.6, 0.2, 0.9]))
    first = family.propose(atlas)
    search(atlas, family, Demands(1.0001), Effort(), Monitor())
    assert (first.score > -np.inf).any()
    assert not (family.propose(atlas).score > -np.inf).any()


@settings(max_examples=12)
@given(st.integers(4, 40), st.integers(0, 9), st.sampled_from(["cube", "ball", "tube"]))
def test_charts_that_hand_regions_over_are_good_and_cost_no_more_than_glued_ones(
    seeds: int, seed: int, name: str
) -> None:
    make = {"cube": shapes.cube, "ball": shapes.icosphere, "tube": lambda: shapes.tube(2.0, 24)}
    atlas = voronoi(make[name](), seeds, seed)
    cut_mesh, uv = atlas.open()
    bound = max(BOUND, energies(cut_mesh, uv).max())
    assume(not judge(cut_mesh, uv).bad(bound).any())
    glued = Atlas(atlas.surface, atlas.cut, atlas.corners)
    options = MergeOptions(bound, MARGIN)
    merge(glued, options, Monitor())
    merge_regions(atlas, options, Monitor())
    assert COST.seams(atlas) <= COST.seams(glued) + 1e-9
    assert_promises(atlas, bound)
