"""How much of the bound noise costs: nothing on smooth meshes, what whole charts tell on rough ones."""

import numpy as np
import pytest

from circparam.seams.multires.decimate import decimate
from circparam.seams.multires.roughness import roughness
from circparam.seams.multires.transfer_layout import nearest_coarse_face
from circparam.seams.segmentation.layout import embed_and_relax
from circparam.solvers.newton import RelaxOptions
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import surface_of

STEPS = RelaxOptions(tolerance=1e-4, max_iterations=60)


def sheet(noise: float, n: int = 110):
    """A square of n · n cells with white noise across it, in edges."""
    points, faces = shapes.grid(n, n)
    rng = np.random.default_rng(0)
    points = points + np.array([0.0, 0.0, 1.0]) * noise / n * rng.normal(size=(len(points), 1))
    return points, faces


def rough(shape, target: int) -> tuple[float, object, object]:
    surface = surface_of(*shape)
    level = decimate(surface, target)
    return (roughness(surface, level.surface, nearest_coarse_face(surface, level)), surface, level)


@pytest.mark.parametrize("shape", [shapes.icosphere(5), sheet(0.0)])
def test_smooth_meshes_are_not_rough(shape) -> None:
    assert rough(shape, 2_000)[0] < 1e-3


@pytest.mark.parametrize("noise", [0.3])
def test_it_is_what_the_distortion_of_a_whole_chart_rises_by(noise: float) -> None:
    told, surface, level = rough(sheet(noise), 2_400)
    whole = [
        chart_energies(c, embed_and_relax(c, STEPS, None))[0]
        for c in (s.cut_mesh(np.zeros(len(s.edges), bool)) for s in (surface, level.surface))
    ]
    rise = whole[0] - whole[1]
    assert rise > 2e-3
    assert 0.6 * rise < told < 1.4 * rise
