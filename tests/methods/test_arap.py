"""As-rigid-as-possible maps: the gradient, the energy against other maps, pins."""

import numpy as np
import pytest

from circparam.methods.arap import rigid_energy
from circparam.methods.pins import Pins, fit_pins
from tests.support import shapes
from tests.support.charts import flat_of, flattened, patches_of


def energy(cut_mesh, uv):
    return float(rigid_energy(cut_mesh, uv, np.zeros(len(uv), bool))[0].sum())


def test_it_is_more_rigid_than_its_start_and_the_other_methods():
    cut_mesh, _ = patches_of(shapes.bumped_disk(500))
    own = energy(cut_mesh, flattened("arap", cut_mesh).uv)
    for other in ("circle", "mean-value", "lscm", "abf", "bff", "isometric"):
        uv = flattened(other, cut_mesh).uv
        assert own < energy(cut_mesh, uv)


@pytest.mark.parametrize("scale", [0.3, 1.0, 2.5])
def test_the_energy_of_a_similarity_is_known(scale):
    """½ A ‖s R − R‖² = A (s − 1)², however the layout is turned."""
    cut_mesh, places = flat_of(shapes.grid(4, 4))
    c, s = scale * np.cos(1.0), scale * np.sin(1.0)
    area = cut_mesh.areas.sum()
    assert energy(cut_mesh, places @ [[c, s], [-s, c]]) == pytest.approx(
        area * (scale - 1) ** 2, abs=1e-12
    )


def test_the_start_does_not_matter():
    cut_mesh, _ = patches_of(shapes.bumped_disk(300, 0.3))
    runs = [
        energy(cut_mesh, flattened("arap", cut_mesh, start=s, tolerance=1e-12).uv)
        for s in ("circle", "floater", "uniform")
    ]
    np.testing.assert_allclose(runs, runs[0], rtol=1e-6)


def test_pins_hold_and_pull():
    cut_mesh, _ = patches_of(shapes.bumped_disk(300, 0.3))
    free = flattened("arap", cut_mesh).uv
    chosen = np.array([0, 10, 20])
    target = free[chosen] + [[0.05, 0], [0, 0.05], [0, 0]]
    layout = flattened("arap", cut_mesh, pins=Pins(chosen, target))
    np.testing.assert_array_equal(layout.uv[chosen], target)
    assert energy(cut_mesh, layout.uv) >= energy(cut_mesh, free)


def test_the_start_is_turned_and_scaled_to_its_pins():
    cut_mesh, points = patches_of(shapes.bumped_disk(100))
    turn, uv = np.array([[0.6, -0.8], [0.8, 0.6]]), points[:, :2]
    pins = Pins(np.array([3, 30, 60]), (3 * uv @ turn.T + [1, -2])[[3, 30, 60]])
    placed, size = fit_pins(cut_mesh, uv, pins)
    np.testing.assert_allclose(placed * size, 3 * uv @ turn.T + [1, -2], atol=1e-12)


def test_one_pin_only_moves_the_chart():
    cut_mesh, _ = patches_of(shapes.bumped_disk(300, 0.3))
    free = flattened("arap", cut_mesh, tolerance=1e-13).uv
    pins = Pins(np.array([4]), np.array([[10.0, 20.0]]))
    layout = flattened("arap", cut_mesh, pins=pins, tolerance=1e-13)
    np.testing.assert_array_equal(layout.uv[4], [10, 20])
    assert energy(cut_mesh, layout.uv) == pytest.approx(energy(cut_mesh, free), rel=1e-6)


def test_iterations_and_reasons_are_reported():
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(150), 2))
    layout = flattened("arap", cut_mesh, max_iterations=2)
    assert layout.iterations.tolist() == [2, 2]
    assert layout.stopped == ["iterations", "iterations"]
    assert flattened("arap", cut_mesh).stopped == ["converged", "converged"]
