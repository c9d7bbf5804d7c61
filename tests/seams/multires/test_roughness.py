"""Charts of a proxy count the roughness that the mesh has and the proxy has not."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import Roughness
from circparam.seams.multires.decimate import Proxy, decimate
from circparam.seams.multires.roughness import with_roughness
from tests.support import shapes
from tests.support.atlases import energies, surface_of, voronoi

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
