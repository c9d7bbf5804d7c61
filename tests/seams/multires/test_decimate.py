"""The proxy: its topology, the cell of every fine vertex, and the roughness that it has lost."""

import dataclasses

import numpy as np
import pytest

from circparam.core.graph import components
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import Roughness
from circparam.mesh.surface import Surface
from circparam.seams.multires.decimate import Proxy, decimate, pair_edges
from circparam.seams.multires.roughness import with_roughness
from tests.support import shapes
from tests.support.atlases import energies, surface_of, voronoi


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


BOUND = 1.05


def rough_sphere(noise: float) -> shapes.Shape:
    """A sphere whose upper half is rough: points off it by so many edges."""
    points, faces = shapes.icosphere(4)
    edge = float(np.linalg.norm(points[faces[:, 0]] - points[faces[:, 1]], axis=1).mean())
    off = noise * edge * np.random.default_rng(0).standard_normal(len(points))
    return points * (1 + off * (points[:, 2] > 0))[:, None], faces


def proxy_of(shape: shapes.Shape) -> Proxy:
    surface = surface_of(*shape)
    return with_roughness(decimate(surface, 500), surface, BOUND)


def values(proxy: Proxy) -> np.ndarray:
    assert proxy.surface.roughness is not None
    return proxy.surface.roughness.values


def test_rough_parts_count_and_smooth_ones_do_not() -> None:
    proxy = proxy_of(rough_sphere(0.25))
    height = proxy.surface.points[proxy.surface.faces, 2].mean(1)
    assert values(proxy)[height > 0.3].mean() > 0.01
    assert values(proxy)[height < -0.3].max() < 1e-3
    assert values(proxy_of(rough_sphere(0.0))).max() < 1e-3


def test_components_that_a_proxy_takes_over_count_nothing() -> None:
    ball = rough_sphere(0.25)
    tiny = shapes.icosphere(1)
    proxy = proxy_of(shapes.join(ball, (tiny[0] + 5, tiny[1])))
    far = proxy.surface.points[proxy.surface.faces].mean(1)[:, 0] > 3
    assert far.sum() == len(tiny[1])
    np.testing.assert_allclose(values(proxy)[far], 0, atol=1e-20)


def test_a_proxy_of_a_level_counts_what_the_level_lost() -> None:
    surface = surface_of(*rough_sphere(0.25))
    level = with_roughness(decimate(surface, 1500), surface, BOUND).surface
    own = with_roughness(decimate(level, 400), dataclasses.replace(level, roughness=None), BOUND)
    both = with_roughness(decimate(level, 400), level, BOUND)
    lost = np.average(values(both) - values(own), weights=both.surface.areas)
    assert level.roughness is not None
    whole = np.average(level.roughness.values, weights=level.areas)
    assert lost == pytest.approx(whole, rel=0.2)


def test_the_energy_of_a_chart_has_the_mean_of_its_faces_up_to_a_limit() -> None:
    plain = voronoi(shapes.icosphere(2), 6)
    n, chart = plain.charts()
    rough = np.random.default_rng(0).uniform(0, 0.04, len(chart)) * (1 + chart % 2)
    surface = dataclasses.replace(plain.surface, roughness=Roughness(rough, 0.03))
    area = np.bincount(chart, plain.surface.areas, n)
    mean = np.bincount(chart, plain.surface.areas * rough, n) / area
    assert (mean < 0.03).any()
    assert (mean > 0.03).any()
    atlas = Atlas(surface, plain.cut, plain.corners)
    expected = energies(*plain.open()) + np.minimum(mean, 0.03)
    np.testing.assert_allclose(energies(*atlas.open()), expected)
    half = chart < n // 2
    np.testing.assert_allclose(energies(*atlas.part(half).open()), expected[: n // 2])
    cut_mesh, uv = atlas.open()
    some = np.arange(n) % 2 == 0
    sub, vertices, _ = cut_mesh.subset(some)
    np.testing.assert_allclose(energies(sub, uv[vertices]), expected[some])
