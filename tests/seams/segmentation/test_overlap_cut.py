"""Charts that lie on themselves are cut between the two layers."""

import numpy as np
import pytest

from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.segmentation.overlap_cut import split_layers
from tests.support import shapes
from tests.support.atlases import as_it_lies, judged, uncut


@pytest.mark.parametrize(("turn", "inner"), [(7.5, 0.7), (10.0, 0.7), (11.0, 0.3)])
def test_sheets_are_cut_apart_across_the_ring(turn: float, inner: float) -> None:
    """Of the last one both sheets lie near the smaller, so that the cut must be kept between them."""
    atlas = as_it_lies(uncut(*shapes.wound(turn, 96, 6, inner)))
    graph = DualGraph(atlas.surface)
    laid = judged(atlas)
    assert laid.overlapping.all()
    done = split_layers(atlas, graph, laid, np.ones(1, bool), edge_costs(atlas))
    assert done.all()
    length = atlas.surface.edge_lengths[atlas.cut].sum()
    assert 1 <= length / (1 - inner) <= 1.5 * atlas.cut.any(), "one cut across the ring"
    assert atlas.charts()[0] == 2
    assert not judged(atlas).overlapping.any()
