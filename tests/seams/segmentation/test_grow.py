"""Regions round seeds far apart, and charts that are disks."""

import dataclasses

import numpy as np
import pytest

from circparam.core.graph import components
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.surface import Surface
from circparam.seams.segmentation import grow
from circparam.seams.segmentation.grow import dual_graph
from tests.support import shapes
from tests.support.atlases import cut_between, middles, surface_of, uncut


def strip(n: int = 6) -> Surface:
    return surface_of(*shapes.grid(n + 1, 2, float(n), 1.0))


def test_steps_across_the_long_sides_of_needles_are_short() -> None:
    """However far apart their centroids are: the way is as long as the two are thin."""
    low, high, height = 0.0, 10.0, 0.01
    points = np.array([[low, 0, 0], [high, 0, 0], [0.1, height, 0], [9.9, -height, 0]])
    graph = dual_graph(surface_of(points, np.array([[0, 1, 2], [1, 0, 3]])))
    assert graph.step == pytest.approx([2 * height / 3], rel=1e-4)
    wide = dual_graph(surface_of(points * [0.01, 1, 1], np.array([[0, 1, 2], [1, 0, 3]])))
    assert wide.step == pytest.approx([np.hypot(0.098, 0.02) / 3], rel=1e-4)


def test_locked_edges_join_faces_to_cells_weighted_by_area() -> None:
    points, faces = shapes.grid(5, 2, 4.0, 1.0)
    surface = repair(Mesh(points, faces, polygons=np.arange(8) // 2))[0]
    graph = dual_graph(surface)
    assert graph.n == 4
    assert np.array_equal(graph.cell, surface.source // 2)
    assert ((graph.tail == graph.head) == surface.locked).all()
    assert graph.step[~surface.locked] == pytest.approx(1.0, rel=1e-6)
    whole = dual_graph(surface, np.ones(len(surface.edges), bool))
    assert whole.n == 1
    # a large and a small triangle: the centre of the cell is that of its area
    points = np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0], [-1, 0, 0], [0, -3, 0]])
    surface = surface_of(points, np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1]]))
    first = (surface.edges // 3 == [0, 1]).all(1) | (surface.edges // 3 == [1, 0]).all(1)
    graph = dual_graph(surface, first)
    centre = (np.array([1.0, 1]) * 4.5 + np.array([-1 / 3, 1]) * 1.5) / 6
    assert graph.step[~first] == pytest.approx([np.linalg.norm(centre - [1.0, -1])], rel=1e-6)


@pytest.mark.parametrize("rounds", [0, 1, 4])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_regions_are_connected_as_many_as_asked_and_nearest_to_their_middles(
    rounds: int, count: int
) -> None:
    surface = surface_of(*shapes.bumped_disk(200))
    graph = dual_graph(surface)
    region = grow.grow(graph.n, graph.tail, graph.head, graph.step, count, rounds)
    assert np.unique(region).tolist() == list(range(count))
    inside = region[graph.tail] == region[graph.head]
    pieces, _ = components(graph.n, graph.tail[inside], graph.head[inside])
    assert pieces == count


def test_seeds_lie_farthest_apart_and_then_move_to_the_middle() -> None:
    """A line of nine cells: the ends first; each half then is as large as the other."""
    tail = np.arange(8)
    cost = np.ones(8)
    ends = grow.grow(9, tail, tail + 1, cost, 2, 0)
    assert sorted(np.bincount(ends).tolist()) == [4, 5]
    assert (np.diff(ends) != 0).sum() == 1
    # a step ten times as long: the far seed lies beyond it
    uneven = np.r_[1.0, 1, 1, 1, 1, 1, 1, 10]
    assert np.bincount(grow.grow(9, tail, tail + 1, uneven, 2, 0)).tolist() == [8, 1]
    # three seeds at 0, 8, 4 hold 2 or 3, 5 or 4 and so on; Lloyd's rounds even them out
    for rounds in (0, 2, 4):
        size = np.bincount(grow.grow(9, tail, tail + 1, cost, 3, rounds))
        assert size.sum() == 9
        assert size.max() <= (5 if rounds == 0 else 4)
    # no more regions than cells, and at least one in every component
    assert len(np.unique(grow.grow(4, np.array([0]), np.array([1]), np.ones(1), 9))) == 4
    assert len(np.unique(grow.grow(4, np.array([0, 2]), np.array([1, 3]), np.ones(2), 1))) == 2


def test_first_charts_keep_the_seams_there_are() -> None:
    surface = strip()
    middle = middles(surface)[:, 0]
    atlas = cut_between(surface, (middle > 3).astype(np.int64))
    before = atlas.cut.copy()
    grow.first_charts(atlas, dual_graph(surface), 4)
    assert atlas.cut[before].all()
    n, chart = atlas.charts()
    assert n == 4
    assert all(len(np.unique(middle[chart == k] > 3)) == 1 for k in range(n))


@pytest.mark.parametrize(
    "shape", [shapes.icosphere(2), shapes.torus(16, 8), shapes.cylinder(12, 3, caps=True)]
)
def test_charts_are_split_until_all_are_disks(shape) -> None:
    atlas = uncut(*shape)
    rounds = grow.make_disks(atlas, dual_graph(atlas.surface))
    assert rounds >= 1
    assert not not_disks(atlas.cut_mesh()).any()
    before = atlas.cut.copy()
    assert grow.make_disks(atlas, dual_graph(atlas.surface)) == 0
    assert np.array_equal(atlas.cut, before)
    again = uncut(*shape)
    assert grow.make_disks(again, dual_graph(again.surface), limit=0) == 0
    assert not again.cut.any()


def test_disks_are_not_split_beside_what_is_none() -> None:
    surface = surface_of(*shapes.join(shapes.grid(5, 5), shapes.icosphere(1)))
    atlas = uncut(*shapes.join(shapes.grid(5, 5), shapes.icosphere(1)))
    grow.make_disks(atlas, dual_graph(surface))
    sheet = surface.edges[:, 0] // 3 < 32
    assert not atlas.cut[sheet].any()
    assert atlas.cut[~sheet].any()
    # one single cell cannot be split
    ball = surface_of(*shapes.icosphere(1))
    locked = dataclasses.replace(ball, locked=np.ones(len(ball.edges), bool))
    stuck = Atlas(locked, np.zeros(len(ball.edges), bool))
    assert grow.make_disks(stuck, dual_graph(locked)) == 0
    assert not stuck.cut.any()
