"""The distortion that roughness leaves in every layout, beside that of layouts."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.roughness import roughness_within
from circparam.seams.accuracy import FINAL
from circparam.seams.segmentation.layout import embed_and_relax
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import surface_of, uncut


def rough_square(noise: float, seed: int = 0) -> shapes.Shape:
    """A square of unit cells whose inner points lie off its plane by so much."""
    points, faces = shapes.grid(30, 30, 30.0, 30.0)
    off = noise * np.random.default_rng(seed).standard_normal(len(points))
    return np.c_[points[:, :2], off], faces


def mean_roughness(shape: shapes.Shape, cell: np.ndarray | None = None) -> float:
    surface = surface_of(*shape)
    one = np.zeros(len(surface.vertex_points), np.int64)
    rough = roughness_within(surface, one if cell is None else cell)
    return float(np.average(rough, weights=surface.areas))


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.3])
def test_it_is_up_to_twice_what_the_layout_of_a_rough_square_keeps(noise: float) -> None:
    shape = rough_square(noise)
    cut_mesh = uncut(*shape).cut_mesh()
    energy = chart_energies(cut_mesh, embed_and_relax(cut_mesh, FINAL, Monitor()))[0]
    assert 1 < mean_roughness(shape) / (energy - 1) < 2.2


def test_it_grows_with_the_fourth_power_of_small_noise() -> None:
    small, double = (mean_roughness(rough_square(noise)) for noise in (0.01, 0.02))
    assert np.log2(double / small) == pytest.approx(4, abs=0.1)


def test_it_depends_on_neither_unit_nor_pose() -> None:
    points, faces = rough_square(0.2)
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    assert mean_roughness((7e3 * points @ turn.T + 4, faces)) == pytest.approx(
        mean_roughness((points, faces)), rel=1e-6
    )


def test_the_mean_curvature_of_cells_is_none() -> None:
    """A sphere bends alike within every cell; a cone bends at its tip alone."""
    sphere = shapes.icosphere(4)
    height = (sphere[0][:, 2] * 4).astype(np.int64)
    assert mean_roughness(sphere, height - height.min()) < 1e-4
    cone = shapes.cone()
    apart = np.arange(len(surface_of(*cone).vertex_points))
    assert mean_roughness(cone, apart) == pytest.approx(0, abs=1e-20)
    assert mean_roughness(cone, 0 * apart) > 1e-3


def test_vertices_without_a_cell_and_needles_leave_finite_numbers() -> None:
    points, faces = rough_square(0.2)
    points[faces[40, 0]] = points[faces[40, 1]] + 1e-13
    surface = surface_of(points, faces)
    rough = roughness_within(surface, np.full(len(surface.vertex_points), -1))
    assert (rough == 0).all()
    rough = roughness_within(surface, np.zeros(len(surface.vertex_points), np.int64))
    assert np.isfinite(rough).all()
    assert (rough >= 0).all()
