"""Least squares conformal maps: spectral, pinned, and pins of the user."""

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.geometry.intrinsic import signed_areas
from circparam.methods.conformal import conformal_matrix
from circparam.methods.pins import Pins
from tests.support import shapes
from tests.support.charts import complex_of, flattened, patches_of


def run(shape, **options):
    cut_mesh, points = patches_of(shape)
    return cut_mesh, points, flattened("lscm", cut_mesh, **options)


def test_the_spectral_map_has_less_energy_at_its_boundary_norm_than_any_pinned_map():
    cut_mesh, _, spectral = run(shapes.bumped_disk(600), repair=False)
    _, _, pinned = run(shapes.bumped_disk(600), lscm="pinned", repair=False)
    boundary = np.unique(cut_mesh.faces.ravel()[cut_mesh.boundary])
    matrix = conformal_matrix(cut_mesh)

    def quotient(layout):
        z = complex_of(layout.uv)
        z = z - z[boundary].mean()
        return np.vdot(z, matrix @ z).real / np.vdot(z[boundary], z[boundary]).real

    assert quotient(spectral) < quotient(pinned)


def test_pins_keep_their_places_and_the_rest_follows():
    cut_mesh, points = patches_of(shapes.half_cylinder())
    flat = flattened("lscm", cut_mesh).uv
    chosen = np.array([0, len(points) - 1, 7])
    moved = 2 * flat @ np.array([[0, 1], [-1, 0]]) + [3, 4]
    layout = flattened("lscm", cut_mesh, pins=Pins(chosen, moved[chosen]))
    np.testing.assert_array_equal(layout.uv[chosen], moved[chosen])
    # three pins of one similarity: the whole map is that similarity
    np.testing.assert_allclose(layout.uv, moved, atol=1e-6)


def test_charts_without_pins_are_still_laid():
    cut_mesh, _ = patches_of(shapes.row_of(shapes.half_cylinder(), 2))
    vertices = np.flatnonzero(cut_mesh.vertex_chart == 0)[[0, -1]]
    layout = flattened("lscm", cut_mesh, pins=Pins(vertices, np.array([[0.0, 0], [1, 1]])))
    np.testing.assert_array_equal(layout.uv[vertices], [[0, 0], [1, 1]])
    free = cut_mesh.chart == 1
    assert signed_areas(cut_mesh.faces, layout.uv)[free].sum() == pytest.approx(
        cut_mesh.areas[free].sum()
    )


@pytest.mark.parametrize(
    ("vertices", "uv", "word"),
    [
        ([0, 10**6], [[0, 0], [1, 0]], "has vertices 0"),
        ([-1, 3], [[0, 0], [1, 0]], "has vertices 0"),
        ([3, 3], [[0, 0], [1, 0]], "pinned twice"),
        ([3], [[0, 0]], "needs 2 or more"),
        ([], np.zeros((0, 2)), "needs 2 or more"),
        ([3, 4], [[1, 1], [1, 1]], "same place"),
    ],
)
def test_bad_pins_are_refused(vertices, uv, word):
    with pytest.raises(OptionError, match=word):
        run(shapes.grid(), pins=Pins(np.array(vertices, int), np.array(uv, float)))


def test_pins_of_the_wrong_shape_and_an_unknown_form_are_refused():
    with pytest.raises(OptionError, match=r"need as many \(u, v\)"):
        Pins(np.array([1, 2]), np.zeros((3, 2)))
    with pytest.raises(OptionError, match="not finite"):
        Pins(np.array([1, 2]), np.array([[0, 0], [np.nan, 1]]))
    with pytest.raises(OptionError, match="unknown form"):
        run(shapes.grid(), lscm="natural")
