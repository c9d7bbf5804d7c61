"""The surface and the cut mesh: charts that follow the seams, shapes that both share."""

import numpy as np
import pytest

from circparam.mesh.cut_mesh import not_disks
from tests.support import shapes
from tests.support.atlases import surface_of
from tests.support.charts import patches_of


def test_a_surface_opened_again_has_its_shapes_and_nothing_that_a_solve_left() -> None:
    surface = surface_of(*shapes.icosphere(2))
    cut = np.zeros(len(surface.edges), bool)
    first = surface.cut_mesh(cut)
    areas = first.areas
    first.eliminated_in(np.arange(first.n_vertices))
    again = surface.cut_mesh(cut.copy())
    assert again.areas is areas
    assert again.elimination is None
    cut[0] = True
    assert surface.cut_mesh(cut).n_vertices == first.n_vertices
    assert len(surface.cut_mesh(cut).edges) == len(first.edges) - 1


@pytest.mark.parametrize(
    ("shape", "disk"),
    [
        (shapes.grid(3, 3), True),
        (shapes.annulus(), True),
        (shapes.icosphere(1), False),
        (shapes.torus(), False),
        ((shapes.torus()[0], shapes.torus()[1][1:]), False),
    ],
)
def test_disks_with_or_without_holes_are_told_from_closed_charts_and_handles(shape, disk) -> None:
    assert not_disks(patches_of(shape)[0]).tolist() == [not disk]


def test_charts_follow_the_seams_also_when_the_same_array_changes() -> None:
    whole = surface_of(*shapes.icosphere(1))
    cut = np.zeros(len(whole.edges), bool)
    assert whole.charts(cut)[0] == 1
    cut[:] = True
    count, chart = whole.charts(cut)
    assert count == len(whole.faces)
    assert whole.charts(cut)[1] is chart
    with pytest.raises(ValueError, match="read-only"):
        chart[0] = 1
    cut[:] = False
    assert whole.charts(cut)[0] == 1


@pytest.mark.parametrize("unit", [1.0, 4.0])
def test_lengths_areas_and_gradients_are_those_in_space_in_any_unit(unit: float) -> None:
    whole = surface_of(*shapes.noisy(*shapes.icosphere(1), 0.1))
    found = whole.cut_mesh(np.zeros(len(whole.edges), bool)).in_units_of(unit)
    p = whole.points[whole.faces] / unit
    sides = np.linalg.norm(np.roll(p, -1, 1) - p, axis=2)
    np.testing.assert_allclose(found.edge_lengths, sides)
    np.testing.assert_allclose(found.lengths(np.arange(sides.size)), sides.ravel())
    np.testing.assert_allclose(found.areas, shapes.areas(p))
    place = np.einsum("fak,fkb->fab", found.gradients, found.rest_triangles)
    np.testing.assert_allclose(place, np.broadcast_to(np.eye(2), place.shape), atol=1e-9)
