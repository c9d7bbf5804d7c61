"""The proxy: its topology, and the cell of every fine vertex."""

import numpy as np
import pytest

from circparam.core.graph import components
from circparam.mesh.surface import Surface
from circparam.seams.multires.decimate import decimate, pair_edges
from tests.support import shapes
from tests.support.atlases import surface_of


def test_the_proxy_keeps_the_genus_and_maps_every_vertex() -> None:
    surface = surface_of(*shapes.torus(60, 30))
    proxy = decimate(surface, 600)
    none = np.zeros(len(proxy.surface.edges), bool)
    assert proxy.surface.cut_mesh(none).euler().tolist() == [0]
    assert len(proxy.surface.faces) < 700
    assert proxy.cell.min() >= 0
    assert set(proxy.cell.tolist()) == set(range(len(proxy.surface.points)))


def cells_are_connected(surface: Surface, cell: np.ndarray) -> bool:
    flat = surface.corner_vertex
    a, b = flat.ravel(), flat[:, [1, 2, 0]].ravel()
    same = cell[a] == cell[b]
    count, _ = components(len(cell), a[same], b[same])
    return count == len(np.unique(cell))


def test_cells_are_connected_and_their_vertices_lie_near() -> None:
    surface = surface_of(*shapes.bumped_disk(600))
    proxy = decimate(surface, 200)
    assert 150 <= len(proxy.surface.faces) <= 220
    assert cells_are_connected(surface, proxy.cell)
    assert proxy.cell.min() == 0
    assert np.array_equal(np.unique(proxy.cell), np.arange(len(proxy.surface.points)))
    away = np.linalg.norm(surface.vertex_points - proxy.surface.points[proxy.cell], axis=1)
    assert away.max() < 0.8
    assert away.mean() < 0.15
    assert len(proxy.apart) == 0
    assert not proxy.surface.locked.any()
    area = surface.areas.sum()
    assert proxy.surface.areas.sum() == pytest.approx(area, rel=0.05)


@pytest.mark.parametrize("shape", [shapes.rod(), shapes.grid(60, 60)])
def test_proxies_of_tubes_and_flats_are_no_slivers(shape: shapes.Shape) -> None:
    """A collapse along a line or inside a plane has no quadric error, however long the edges become."""
    proxy = decimate(surface_of(*shape), 1_000).surface
    corner = proxy.points[proxy.faces]
    edges = np.linalg.norm(corner - np.roll(corner, 1, 1), axis=2)
    height = 2 * proxy.areas / edges.max(1)
    assert np.quantile(height / edges.max(1), 0.25) > 0.1
    assert edges.max() < 20 * np.sqrt(proxy.areas.mean())


def test_components_of_few_faces_are_taken_over_as_they_are() -> None:
    """300 faces are few, 320 are not; a mesh of small ones only stays whole."""
    small, large = shapes.grid(11, 16), shapes.icosphere(2)
    assert (len(small[1]), len(large[1])) == (300, 320)
    far = small[0] + np.array([5.0, 0, 0])
    surface = surface_of(*shapes.join((far, small[1]), large))
    proxy = decimate(surface, 124)
    sheet = proxy.surface.points[proxy.surface.faces].mean(1)[:, 0] > 3
    assert sheet.sum() == 300
    assert 40 <= (~sheet).sum() <= 100
    on_sheet = surface.vertex_points[:, 0] > 3
    assert proxy.surface.points[proxy.cell[on_sheet]] == pytest.approx(
        surface.vertex_points[on_sheet]
    )
    alone = decimate(surface_of(*small), 10)
    assert len(alone.surface.faces) == 300
    assert np.array_equal(np.sort(alone.cell), np.arange(len(small[0])))


def test_edges_of_several_faces_or_of_one_direction_are_told_apart() -> None:
    points, faces = shapes.fins(3, 2)
    surface, apart = pair_edges(points, faces)
    ends = points[apart]
    assert len(apart) >= 1
    assert (np.abs(ends[:, :, :2]) < 1e-9).all(), "all on the axis"
    assert (apart[:, 0] < apart[:, 1]).all()
    assert len(surface.edges) == 3, "the diagonals"
    assert np.array_equal(surface.source, np.arange(len(faces)))
    # two faces wound against each other share no inner edge
    torn, apart = pair_edges(np.eye(4, 3), np.array([[0, 1, 2], [0, 1, 3]]))
    assert len(torn.edges) == 0
    assert np.unique(apart, axis=0).tolist() == [[0, 1]]
    whole, apart = pair_edges(np.eye(4, 3), np.array([[0, 1, 2], [1, 0, 3]]))
    assert len(whole.edges) == 1
    assert len(apart) == 0
