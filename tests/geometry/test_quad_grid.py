"""Grids of quads: which charts are some, and that rows and columns are straight at right angles."""

import numpy as np
import pytest

from circparam.geometry.quad_grid import diagonals, grid_layout
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import RepairOptions, repair
from circparam.solvers.objective import chart_energies
from tests.support import shapes


def opened(points: np.ndarray, faces: np.ndarray) -> CutMesh:
    """The surface without seams."""
    surface, _ = repair(Mesh(points, faces), RepairOptions(0.0, True, by_position=True))
    return surface.cut_mesh(np.zeros(len(surface.edges), bool))


def laid_out(mesh: CutMesh) -> tuple[np.ndarray, np.ndarray]:
    return grid_layout(mesh, diagonals(mesh, np.zeros(len(mesh.edges), bool)))


def turned_diagonals(faces: np.ndarray, seed: int) -> np.ndarray:
    """The quads of ``shapes.grid`` cut along either diagonal, at random."""
    quad = faces.reshape(-1, 6)[:, [0, 1, 2, 5]]
    other = np.random.default_rng(seed).random(len(quad)) < 0.5
    quad[other] = np.roll(quad[other], 1, 1)
    return np.stack([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]], 1).reshape(-1, 3)


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_a_bent_sheet_becomes_a_rectangle(seed: int | None) -> None:
    """Whatever the diagonals and the order of vertices and faces."""
    points, faces = shapes.grid(12, 5, 3.0, 1.0)
    points[:, 2] = 0.05 * np.sin(3 * points[:, 0]) * np.cos(2 * points[:, 1])  # does not unroll
    if seed is not None:
        points, faces = shapes.shuffled(points, turned_diagonals(faces, seed), seed)[:2]
    mesh = opened(points, faces)
    uv, grid = laid_out(mesh)
    assert grid.tolist() == [True]
    assert {len(np.unique(np.round(uv[:, axis], 9))) for axis in (0, 1)} == {12, 5}
    area = shapes.areas(uv[mesh.faces])
    assert area.min() > 0
    assert area.sum() == pytest.approx(np.ptp(uv, axis=0).prod(), rel=1e-12)
    assert chart_energies(mesh, uv)[0] < 1.01


@pytest.mark.parametrize(
    ("shape", "why"),
    [
        (shapes.delaunay_square(200), "no quads"),
        (shapes.hemisphere(8), "a pole, or vertices with three quads"),
        (shapes.annulus(32, 6), "columns that close round a hole"),
        (shapes.tube(2.0, 12, closed=False), "a tube that is not cut"),
    ],
)
def test_other_charts_are_no_grid(shape: tuple[np.ndarray, np.ndarray], why: str) -> None:
    uv, grid = laid_out(opened(*shape))
    assert not grid.any(), why
    assert not uv.any()


def test_an_inner_edge_of_a_polygon_is_the_diagonal() -> None:
    """A sheared sheet: the longest sides of its triangles are rows, and only the file tells the quads."""
    points, faces = shapes.grid(6, 4)
    points[:, 1] *= 0.3
    points[:, 0] -= 0.9 * points[:, 1] / 0.3
    points[:, 2] = 0.02 * np.sin(5 * points[:, 0])
    polygons = np.repeat(np.arange(len(faces) // 2), 2)
    surface, _ = repair(
        Mesh(points, faces, polygons=polygons), RepairOptions(0.0, True, by_position=True)
    )
    mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    assert surface.locked.sum() == len(faces) // 2
    diagonal = diagonals(mesh, surface.locked)
    assert grid_layout(mesh, diagonal)[1].all()
    assert (diagonal != mesh.edge_lengths.argmax(1)).any()
