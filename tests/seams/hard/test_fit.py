"""Two layouts moved together, as they are or bent."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.geometry.overlap import SelfContacts, self_overlapping
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.hard.fit import better_start, composed, hardly_near
from circparam.seams.hard.regions import (
    turns,
)
from circparam.seams.hard.unroll import unroll
from circparam.seams.segmentation.unions import _turns
from circparam.solvers import dirichlet
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import as_it_lies, surface_of
from tests.support.parts import extrude, rectangle


def test_layouts_that_fit_along_a_hinge_are_joined_exactly() -> None:
    """Two sides of a box, each laid out somewhere: moved together they are the box untangled."""
    part = extrude(rectangle(1.0, 1.0))
    surface = surface_of(part.points, part.faces)
    label = part.surface[surface.source]
    angle, _ = turns(surface)
    two = np.isin(label, [0, 2])
    sides = surface.part(two)
    cut = np.zeros(len(sides.edges), bool)
    apart = Atlas(sides, turns(sides)[0] > 1)
    cut_mesh = apart.cut_mesh()
    uv = unroll(cut_mesh)
    rotation = shapes.rotation(3)[:2, :2]
    rotation = np.linalg.svd(rotation)[0]
    rotation[0] *= np.sign(np.linalg.det(rotation))
    moved = cut_mesh.vertex_chart == 1
    uv[moved] = uv[moved] @ rotation + [3.0, -2.0]
    joined = sides.cut_mesh(cut)
    right = cut_mesh.chart == 1
    turn = _turns(joined, uv[cut_mesh.faces], right)
    together, value, parts = composed(joined, uv[cut_mesh.faces], right, turn)
    assert (angle > 1).any()
    assert parts == pytest.approx([1.0])
    assert value == pytest.approx([1.0])
    assert not self_overlapping(joined, together).any()


def sheet_in_two(angle: float, gap: float = 0.0) -> tuple[CutMesh, np.ndarray, np.ndarray]:
    """A flat sheet whose right half lies elsewhere, turned: (the whole, corners, faces on the right)."""
    surface = surface_of(*shapes.grid(9, 5))
    right = surface.points[surface.faces].mean(1)[:, 0] > 0.5
    flat = surface.points[surface.faces][:, :, :2]
    c, s = np.cos(angle), np.sin(angle)
    away = flat @ np.array([[c, s], [-s, c]]) + np.array([4.0 + gap, 1.0])
    corners = np.where(right[:, None, None], away, flat)
    return surface.cut_mesh(np.zeros(len(surface.edges), bool)), corners, right


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, -2.5])
def test_parts_of_a_sheet_moved_together_are_the_sheet(angle: float) -> None:
    cut_mesh, corners, right = sheet_in_two(angle)
    back = np.array([[np.cos(-angle), np.sin(-angle)]])
    uv, energy, apart = composed(cut_mesh, corners, right, back)
    assert energy == pytest.approx([1.0])
    assert apart == pytest.approx([1.0])
    assert np.ptp(uv, axis=0) == pytest.approx([1.0, 1.0])


def test_parts_that_do_not_fit_lose_by_it() -> None:
    """Turned a little too far: the layouts apart are perfect, the one together is not."""
    cut_mesh, corners, right = sheet_in_two(0.0)
    turn = np.array([[np.cos(0.1), np.sin(0.1)]])
    _, energy, apart = composed(cut_mesh, corners, right, turn)
    assert apart == pytest.approx([1.0])
    assert 1.001 < energy[0] < 2
    # turned round, its faces would flip where both meet
    _, energy, _ = composed(cut_mesh, corners, right, -turn)
    assert energy[0] > 10


def test_few_near_places_are_told_from_crossings_and_from_many() -> None:
    """Three sheets in one cut mesh: alone; with a narrow gap between its ends; lying on itself."""

    def ring(turn: float, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
        t = np.linspace(0, turn, n)
        rim = [np.stack([r * np.cos(t), r * np.sin(t), 1e-4 * t], 1) for r in (0.8, 1.0)]
        k = np.arange(n - 1)
        faces = np.r_[np.stack([k, n + k, n + k + 1], 1), np.stack([k, n + k + 1, k + 1], 1)]
        return np.concatenate(rim), faces

    parts = [ring(4.0), ring(2 * np.pi - 0.004), ring(2 * np.pi + 0.4)]
    surface = surface_of(
        *shapes.join(*[(p + np.array([4.0 * k, 0, 0]), f) for k, (p, f) in enumerate(parts)])
    )
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    atlas = as_it_lies(Atlas(surface, np.zeros(len(surface.edges), bool)))
    uv = atlas.gather(cut_mesh)
    every = np.ones(3, bool)
    contacts = SelfContacts.of(cut_mesh, uv)
    assert hardly_near(contacts, every, 0.01).tolist() == [True, True, False]
    assert hardly_near(contacts, np.array([False, True, True]), 0.01).tolist() == [
        False, True, False,
    ]  # fmt: skip


def test_of_two_starts_the_better_one_is_taken() -> None:
    """A poor start bends its smaller part round the larger one: on a sheet that makes it perfect."""
    cut_mesh, corners, right = sheet_in_two(0.0)
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jacobian = dirichlet.jacobians(gradients, corners.transpose(2, 1, 0))
    c, s = np.cos(1.0), np.sin(1.0)
    turned = np.stack([c * jacobian[0] - s * jacobian[1], s * jacobian[0] + c * jacobian[1]])
    targets = np.where(right, turned, jacobian)
    poor = chart_energies(cut_mesh, better_start(cut_mesh, targets, jacobian, right, np.inf)[0])
    good = chart_energies(cut_mesh, better_start(cut_mesh, targets, jacobian, right, 1.05)[0])
    assert poor[0] > 1.05
    assert good == pytest.approx([1.0])
    best = chart_energies(cut_mesh, better_start(cut_mesh, jacobian, jacobian, right, 1.05)[0])
    assert best == pytest.approx([1.0])
