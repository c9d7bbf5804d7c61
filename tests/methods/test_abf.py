"""Angle based flattening: the conditions hold, the linear form is its first step, failure is told."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.intrinsic import corner_angles, vertex_angle_sums
from circparam.methods.abf import solve_angles
from tests.support import shapes
from tests.support.charts import charts_of, flattened, patches_of, rim


def laid_angles(cut_mesh, uv):
    return corner_angles(charts_of(cut_mesh.faces, uv)[0])


def angle_cost(cut_mesh, uv):
    """Mean of ((α − β)/β)², β the angles rescaled to 2π round inner vertices."""
    target = corner_angles(cut_mesh)
    turn = np.where(rim(cut_mesh), 1.0, 2 * np.pi / vertex_angle_sums(cut_mesh, target))
    target = target * turn[cut_mesh.faces]
    return float((((laid_angles(cut_mesh, uv) - target) / target) ** 2).mean())


@pytest.mark.parametrize("height", [0.3, 0.8])
def test_angles_are_nearer_to_their_targets_than_those_of_lscm(height):
    cut_mesh, _ = patches_of(shapes.bumped_disk(500, height))
    full = angle_cost(cut_mesh, flattened("abf", cut_mesh).uv)
    linear = angle_cost(cut_mesh, flattened("abf", cut_mesh, linear=True).uv)
    conformal = angle_cost(cut_mesh, flattened("lscm", cut_mesh).uv)
    assert full < conformal
    assert full <= linear * 1.0001
    assert linear < 1.5 * full


def test_a_chart_that_does_not_converge_takes_the_linear_form_and_is_told():
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(200), 2))
    layout = flattened("abf", cut_mesh, max_iterations=2)
    linear = flattened("abf", cut_mesh, linear=True)
    assert any("did not converge on 2 charts" in note for note in layout.notes)
    np.testing.assert_allclose(layout.uv, linear.uv, atol=1e-9)
    assert linear.notes == []


@pytest.mark.parametrize("height", [0.1, 0.3])
def test_angles_round_holes_fit_together(height):
    cut_mesh, _ = patches_of(shapes.waved(shapes.planar_holes(4, seed=4), height))
    angles, _, converged = solve_angles(cut_mesh, 20, Monitor())
    assert converged.all()
    # a plane map with exactly these angles exists: nothing is left for the reconstruction to share out
    layout = flattened("abf", cut_mesh)
    np.testing.assert_allclose(laid_angles(cut_mesh, layout.uv), angles, atol=1e-6)
