"""Regions round seeds far apart, and charts that are disks."""

import dataclasses

import numpy as np
import pytest

from circparam.core.graph import components
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.seams.segmentation import grow
from circparam.seams.segmentation.grow import DualGraph
from tests.support import shapes
from tests.support.atlases import cut_between, middles, surface_of, uncut


@pytest.mark.parametrize("rounds", [0, 1, 4])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_regions_are_connected_as_many_as_asked_and_nearest_to_their_middles(rounds, count):
    surface = surface_of(*shapes.bumped_disk(200))
    graph = DualGraph(surface)
    region = grow.grow(graph.n, graph.tail, graph.head, graph.step, count, rounds)
    assert np.unique(region).tolist() == list(range(count))
    inside = region[graph.tail] == region[graph.head]
    pieces, _ = components(graph.n, graph.tail[inside], graph.head[inside])
    assert pieces == count


def test_first_charts_keep_the_seams_there_are() -> None:
    surface = surface_of(*shapes.grid(7, 2, 6.0, 1.0))
    middle = middles(surface)[:, 0]
    atlas = cut_between(surface, (middle > 3).astype(np.int64))
    before = atlas.cut.copy()
    grow.first_charts(atlas, DualGraph(surface), 4)
    assert atlas.cut[before].all()
    n, chart = atlas.charts()
    assert n == 4
    assert all(len(np.unique(middle[chart == k] > 3)) == 1 for k in range(n))


@pytest.mark.parametrize(
    "shape", [shapes.icosphere(2), shapes.torus(16, 8), shapes.cylinder(12, 3, caps=True)]
)
def test_charts_are_split_until_all_are_disks(shape) -> None:
    atlas = uncut(*shape)
    assert not_disks(atlas.cut_mesh()).any()
    grow.make_disks(atlas, DualGraph(atlas.surface))
    assert not not_disks(atlas.cut_mesh()).any()
    before = atlas.cut.copy()
    grow.make_disks(atlas, DualGraph(atlas.surface))
    assert np.array_equal(atlas.cut, before)


def test_disks_are_not_split_beside_what_is_none() -> None:
    surface = surface_of(*shapes.join(shapes.grid(5, 5), shapes.icosphere(1)))
    atlas = uncut(*shapes.join(shapes.grid(5, 5), shapes.icosphere(1)))
    grow.make_disks(atlas, DualGraph(surface))
    sheet = surface.edges[:, 0] // 3 < 32
    assert not atlas.cut[sheet].any()
    assert atlas.cut[~sheet].any()
    # one single cell cannot be split
    ball = surface_of(*shapes.icosphere(1))
    locked = dataclasses.replace(ball, locked=np.ones(len(ball.edges), bool))
    stuck = Atlas(locked, np.zeros(len(ball.edges), bool))
    grow.make_disks(stuck, DualGraph(locked))
    assert not stuck.cut.any()
