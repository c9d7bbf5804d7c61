"""Halves of charts: equal areas, each in one piece, and equally distorted where there is a layout."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import Roughness
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.segmentation.halves import halve_between_ends, halve_evenly
from circparam.seams.segmentation.layout import judge
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import as_it_lies, middles, uncut

SHEET, STRIP = shapes.grid(40, 20, 2.0, 1.0), shapes.grid(40, 4, 10.0, 1.0)


def rough_disk() -> shapes.Shape:
    """A disk with bumps and noise on them."""
    points, faces = shapes.bumped_disk(400)
    return points + np.random.default_rng(0).normal(size=(len(points), 1)) * [0, 0, 0.02], faces


def halved(how: str, atlas: Atlas, locked: np.ndarray | None = None) -> np.ndarray:
    """Halve the first chart; what each face was in before."""
    layouts, (n, chart) = judge(*atlas.open()), atlas.charts()
    graph, which = DualGraph(atlas.surface, locked), np.arange(n) == 0
    if how == "evenly":
        halve_evenly(atlas, graph, layouts, which)
    else:
        halve_between_ends(atlas, graph, chart, which)
    return chart


def with_roughness(atlas: Atlas, axis: int) -> Atlas:
    """As if the distortion grew along an axis."""
    rough = Roughness(0.1 * middles(atlas.surface)[:, axis], 1.0)
    return Atlas(dataclasses.replace(atlas.surface, roughness=rough), atlas.cut, atlas.corners)


@pytest.mark.parametrize("how", ["between ends", "evenly"])
@pytest.mark.parametrize("shape", [SHEET, STRIP, rough_disk()])
def test_halves_are_whole_and_of_one_area_and_others_stay(how: str, shape: shapes.Shape) -> None:
    """Between its ends a chart is cut across where it is long."""
    atlas = as_it_lies(uncut(*shapes.join(shape, shapes.grid(5, 5))))
    before = halved(how, atlas)
    n, chart = atlas.charts()
    assert n == 3
    one, other = np.bincount(chart, atlas.surface.areas)[np.unique(chart[before == 0])]
    assert abs(one - other) < 0.2 * (one + other)
    assert atlas.seam_length < (0.6 if shape is STRIP and how == "between ends" else 2)


@pytest.mark.parametrize("how", ["between ends", "evenly"])
def test_halves_consist_of_whole_cells(how: str) -> None:
    """Of two cells each is a half, however small one is; of one cell there are none."""
    atlas = as_it_lies(uncut(*shapes.grid(5, 5)))
    small = middles(atlas.surface)[:, 0] < 0.25
    left, right = small[atlas.surface.sides]
    halved(how, atlas, np.ones(len(left), bool))
    assert not atlas.cut.any()
    halved(how, atlas, left == right)
    assert np.array_equal(atlas.cut, left != right)


def test_halves_are_equally_distorted() -> None:
    """The layout stretches faces more, the further along they lie: half of it is across, along the sheet."""
    found = {}
    for how in ("between ends", "evenly"):
        atlas = as_it_lies(uncut(*SHEET))
        atlas.corners = atlas.corners + 0.1 * atlas.corners[..., :1] ** 2 * [1, 0]
        cut_mesh, uv = atlas.open()
        halved(how, atlas)
        atlas.scatter(cut_mesh, uv)
        one, other = chart_energies(*atlas.open())
        found[how] = abs(one - other) / (chart_energies(cut_mesh, uv)[0] - 1)
    assert found["evenly"] < 0.01 < 1 < found["between ends"]


def test_roughness_that_a_surface_leaves_out_is_halved_too() -> None:
    atlas = with_roughness(as_it_lies(uncut(*SHEET)), 0)
    halved("evenly", atlas)
    cut_mesh = atlas.cut_mesh()
    assert cut_mesh.n_charts == 2
    assert np.ptp(cut_mesh.chart_roughness) < 0.01 * cut_mesh.chart_roughness.mean()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_bay_does_not_make_three_parts(axis: int) -> None:
    """A horseshoe cut across both legs: the foot of the shorter leg stays with the rest."""
    points, faces = shapes.grid(20, 20)
    x, y = points[faces].mean(1)[:, :2].T
    atlas = as_it_lies(uncut(points, faces[(np.abs(x - 0.5) >= 0.25) | (y >= 0.75)]))
    atlas = with_roughness(atlas, axis)  # along the legs, or from one to the other
    assert atlas.charts()[0] == 1
    halved("evenly", atlas)
    assert atlas.charts()[0] == 2


def test_a_layout_that_all_but_collapsed_is_halved() -> None:
    """Its energies are no finite numbers, and warnings are errors."""
    atlas = as_it_lies(uncut(*SHEET))
    atlas.corners = atlas.corners * [1, 1e-200]
    halved("evenly", atlas)
    assert atlas.charts()[0] == 2
