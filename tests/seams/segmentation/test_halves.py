"""Halves of charts: equal areas, each in one piece, and equally distorted where there is a layout."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.roughness import Roughness
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.segmentation.halves import halve_between_ends, halve_evenly
from circparam.seams.segmentation.layout import ChartLayouts, judge
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import middles, surface_of, uncut


@pytest.mark.parametrize("shape", [shapes.bumped_disk(400), shapes.grid(40, 4, 10.0, 1.0)])
def test_halves_have_one_area_and_are_whole(shape) -> None:
    atlas = uncut(*shape)
    areas = atlas.surface.areas
    _, chart = atlas.charts()
    halve_between_ends(atlas, DualGraph(atlas.surface), chart, np.array([True]))
    n, chart = atlas.charts()
    assert n == 2
    assert abs(np.diff(np.bincount(chart, areas))[0]) <= 2 * areas.max()


def test_a_long_chart_is_halved_across_and_others_stay() -> None:
    surface = surface_of(*shapes.join(shapes.grid(40, 4, 10.0, 1.0), shapes.grid(5, 5)))
    atlas = uncut(*shapes.join(shapes.grid(40, 4, 10.0, 1.0), shapes.grid(5, 5)))
    _, chart = atlas.charts()
    halve_between_ends(atlas, DualGraph(surface), chart, np.array([True, False]))
    assert atlas.charts()[0] == 3
    assert surface.edge_lengths[atlas.cut].sum() < 2  # of 20 round it
    share = np.bincount(atlas.charts()[1][chart == 0]) / (chart == 0).sum()
    np.testing.assert_allclose(share, 0.5, atol=0.02)


def test_charts_of_one_cell_cannot_be_halved() -> None:
    surface = surface_of(*shapes.grid(3, 2))
    whole = np.ones(len(surface.edges), bool)
    atlas = uncut(*shapes.grid(3, 2))
    halve_between_ends(atlas, DualGraph(surface, whole), atlas.charts()[1], np.array([True]))
    assert not atlas.cut.any()


@pytest.mark.parametrize("halve", ["between ends", "evenly"])
def test_of_two_cells_each_is_a_half(halve) -> None:
    """However small one of them is."""
    atlas = uncut(*shapes.grid(5, 5))
    atlas.corners = atlas.surface.points[atlas.surface.faces][:, :, :2]
    small = middles(atlas.surface)[:, 0] < 0.25
    left, right = small[atlas.surface.sides]
    graph, which = DualGraph(atlas.surface, left == right), np.array([True])
    if halve == "evenly":
        halve_evenly(atlas, graph, judge(*atlas.open()), which)
    else:
        halve_between_ends(atlas, graph, atlas.charts()[1], which)
    assert np.array_equal(atlas.cut, left != right)


LONG = shapes.grid(40, 20, 2.0, 1.0)


def test_halves_are_equally_distorted() -> None:
    """The layout stretches faces more, the further along they lie: half of it is across, along the sheet."""
    atlas, layouts = stretched()
    halve_evenly(atlas, DualGraph(atlas.surface), layouts, np.array([True]))
    one, other = energies_of_parts(atlas, layouts)
    assert one == pytest.approx(other, abs=0.01 * (layouts.energy[0] - 1))
    # between its ends one half keeps most of the distortion
    across, _ = stretched()
    halve_between_ends(across, DualGraph(across.surface), *whole_of(across))
    one, other = energies_of_parts(across, layouts)
    assert abs(one - other) > layouts.energy[0] - 1


def test_roughness_that_a_surface_leaves_out_is_halved_too() -> None:
    surface = surface_of(*LONG)
    along = surface.points[surface.faces].mean(1)[:, 0]
    rough = dataclasses.replace(surface, roughness=Roughness(0.1 * along, 1.0))
    atlas = Atlas(rough, np.zeros(len(rough.edges), bool))
    atlas.corners = rough.points[rough.faces][:, :, :2]
    halve_evenly(atlas, DualGraph(rough), judge(*atlas.open()), np.array([True]))
    cut_mesh = atlas.cut_mesh()
    assert cut_mesh.n_charts == 2
    assert np.ptp(cut_mesh.chart_roughness) < 0.01 * cut_mesh.chart_roughness.mean()


@pytest.mark.parametrize("seed", range(5))
def test_even_halves_of_a_rough_chart_have_one_area_and_are_whole(seed) -> None:
    points, faces = shapes.bumped_disk(400)
    points[:, 2] += 0.02 * np.random.default_rng(seed).standard_normal(len(points))
    atlas = uncut(points, faces)
    atlas.corners = points[faces][:, :, :2]
    layouts = judge(*atlas.open())
    halve_evenly(atlas, DualGraph(atlas.surface), layouts, np.array([True]))
    n, chart = atlas.charts()
    assert n == 2
    area = np.bincount(chart, atlas.surface.areas)
    assert area.min() > 0.4 * area.sum()


@pytest.mark.parametrize("wide", [0, 1])
def test_a_bay_does_not_make_three_parts(wide) -> None:
    """A horseshoe cut across both legs: the foot of the shorter leg stays with the rest."""
    points, faces = shapes.grid(20, 20)
    middle = points[faces].mean(1)
    bay = (np.abs(middle[:, 0] - 0.5) < 0.25) & (middle[:, 1] < 0.75)
    atlas = uncut(points, faces[~bay])
    atlas.corners = points[faces[~bay]][:, :, :2]
    layouts = judge(*atlas.open())
    # as if the distortion grew along the legs, or from one to the other
    along = points[faces[~bay]].mean(1)[:, wide]
    atlas.surface = dataclasses.replace(atlas.surface, roughness=Roughness(0.1 * along, 1.0))
    halve_evenly(atlas, DualGraph(atlas.surface), judge(*atlas.open()), np.array([True]))
    assert layouts.cut_mesh.n_charts == 1
    assert atlas.charts()[0] == 2


def test_even_halves_leave_other_charts_and_cells_alone() -> None:
    shape = shapes.join(LONG, shapes.grid(5, 5))
    surface = surface_of(*shape)
    locked = np.zeros(len(surface.edges), bool)
    locked[:600] = True
    atlas = uncut(*shape)
    atlas.corners = surface.points[surface.faces][:, :, :2]
    layouts = judge(*atlas.open())
    halve_evenly(atlas, DualGraph(surface, locked), layouts, np.array([True, False]))
    second = layouts.cut_mesh.chart[surface.sides[0]] == 1
    assert atlas.cut.any()
    assert not atlas.cut[locked | second].any()


def stretched() -> tuple[Atlas, ChartLayouts]:
    """A sheet twice as long as wide, stretched along it by 0 to 40 %."""
    atlas = uncut(*LONG)
    p = atlas.surface.points[atlas.surface.faces][:, :, :2]
    atlas.corners = np.stack([p[..., 0] + 0.1 * p[..., 0] ** 2, p[..., 1]], axis=-1)
    return atlas, judge(*atlas.open())


def whole_of(atlas: Atlas) -> tuple[np.ndarray, np.ndarray]:
    """The one chart of an atlas, as halving takes it."""
    return atlas.charts()[1], np.array([True])


def energies_of_parts(atlas: Atlas, layouts: ChartLayouts) -> tuple[float, float]:
    """Energies of both halves in the layout of the whole."""
    atlas.scatter(layouts.cut_mesh, layouts.uv)
    one, other = chart_energies(*atlas.open())
    return one, other
