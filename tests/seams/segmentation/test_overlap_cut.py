"""Charts that lie on themselves are cut between the two layers."""

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
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


def split_until_sound(atlas: Atlas) -> None:
    """Cut layers apart, pieces as they lie, until no chart has any."""
    for _ in range(6):
        laid = judged(atlas)
        if not laid.overlapping.any():
            return
        graph = DualGraph(atlas.surface)
        assert split_layers(atlas, graph, laid, laid.overlapping, edge_costs(atlas)).any()


@pytest.mark.parametrize("beyond", [1e-3, 1e-4, 1e-6])
def test_parts_that_share_less_than_any_face_are_cut_off(beyond: float) -> None:
    """A corner that pokes over a side: halves of the chart would keep it, each with a seam right across."""
    atlas = as_it_lies(uncut(*shapes.wound(2 * np.pi + beyond, 96, 6)))
    assert judged(atlas).overlapping.all()
    split_until_sound(atlas)
    assert judged(atlas).cut_mesh.chart_areas.max() > 0.9 * atlas.surface.areas.sum()


@pytest.mark.parametrize("far", [0.2, 0.5])
def test_flipped_parts_are_cut_off_with_what_is_beside_them(far: float) -> None:
    """A vertex dragged over its neighbours: the rest keeps the layout that it has, and no needle is alone."""
    points, faces = shapes.grid(21, 21)
    atlas = as_it_lies(uncut(points, faces))
    vertex = np.flatnonzero(np.isclose(points[:, :2], 0.5).all(1))
    atlas.corners[faces == vertex[0]] += [far, 0.0]
    laid = judged(atlas)
    assert not np.isfinite(laid.energy).any()
    assert split_layers(
        atlas, DualGraph(atlas.surface), laid, laid.overlapping, edge_costs(atlas)
    ).all()
    laid = judged(atlas)
    sizes = np.bincount(laid.cut_mesh.chart)
    assert sizes.max() > 0.8 * len(faces)
    assert laid.energy[sizes.argmax()] < 2
    assert sizes.min() > 3
