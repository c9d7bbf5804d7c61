"""Charts with holes: planes and developable surfaces come back exactly, curved ones keep their angles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import circparam
from circparam.geometry.distortion import measure
from tests.support import shapes
from tests.support.charts import flattened, patches_of

# method and options of unwrap: one solve, or as good as one
EXACT = [("bff", {}), ("abf", {}), ("abf", {"linear": True}), ("lscm", {})]
NAMES = [name + "-linear" * bool(keywords) for name, keywords in EXACT]
moved = st.builds(shapes.rotation, st.integers(0, 99))


def bent(shape, angle):
    """A ruled rectangle on a cylinder that it covers by this angle."""
    p, f = shape
    a = angle / 2 * p[:, 0]
    return np.stack([np.sin(a), p[:, 1], np.cos(a)], 1) * [2 / angle, 1, 2 / angle], f


def conical(shape, half_angle=0.6, angle=2.0):
    """A ruled rectangle on a cone: its lines become rays, y the distance from the apex."""
    p, f = shape
    r, a = 1.5 + p[:, 1], angle * p[:, 0]
    flat = r * np.sin(half_angle)
    return np.stack([flat * np.sin(a), flat * np.cos(a), r * np.cos(half_angle)], 1), f


@pytest.mark.parametrize("method", ["arap", "isometric"])
@pytest.mark.parametrize("holes", [0, 3])
def test_a_plane_figure_comes_back_by_iteration(method, holes):
    p, f = shapes.planar_holes(holes, seed=holes + 10)
    p = p @ shapes.rotation(holes).T + [3, -2, 5]
    for cut in ("disk", "none") if holes == 0 else ("disk",):
        result = circparam.unwrap((p, f), method=method, cut=cut)
        assert result.status in ("ok", "repaired")  # holes may touch in a vertex
        assert result.measures["charts"] == 1
        assert result.measures["flips"] == 0
        assert result.measures["distortion"] <= 1 + 1e-5


@pytest.mark.parametrize(("method", "keywords"), EXACT, ids=NAMES)
@given(holes=st.integers(0, 6), seed=st.integers(0, 2**20), turn=moved)
@settings(max_examples=6, deadline=None)
def test_any_plane_figure_comes_back_by_one_solve(method, keywords, holes, seed, turn):
    p, f = shapes.planar_holes(holes, seed, n=300)
    result = circparam.unwrap((p @ turn.T, f), method=method, cut="disk", **keywords)
    assert result.measures["flips"] == 0
    assert result.measures["distortion"] <= 1 + 1e-7


@pytest.mark.parametrize(("method", "keywords"), EXACT, ids=NAMES)
@pytest.mark.parametrize("holes", [1, 6])
@pytest.mark.parametrize("bend", [lambda s: bent(s, 1.0), lambda s: bent(s, 5.0), conical])
def test_a_developable_surface_with_holes_comes_back(method, keywords, holes, bend):
    shape = bend(shapes.ruled_holes(holes, seed=holes))
    result = circparam.unwrap(shape, method=method, cut="disk", **keywords)
    assert result.measures["flips"] == 0
    assert result.measures["distortion"] <= 1 + 1e-7


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("height", [0.1, 0.3])
@pytest.mark.parametrize("holes", [1, 4])
def test_curved_charts_with_holes_keep_angles_about_as_well_as_lscm(holes, height, linear):
    """With virtual faces over its holes bff lost three times as many angles as lscm, abf twice as many."""
    cut_mesh, _ = patches_of(shapes.waved(shapes.planar_holes(holes, seed=holes), height))
    least = run("lscm", cut_mesh)
    for name in ("abf",) if linear else ("abf", "bff"):
        m = run(name, cut_mesh, linear=linear)
        assert m.flips == 0
        assert m.whole["angle"] - 1 < 1.3 * (least.whole["angle"] - 1) + 1e-3


def run(name, cut_mesh, **options):
    layout = flattened(name, cut_mesh, **options)
    assert layout.notes == []
    return measure(cut_mesh, layout.uv)


@pytest.mark.parametrize(("method", "keywords"), EXACT[:3], ids=NAMES[:3])
@pytest.mark.parametrize("seed", [1, 4])
def test_a_sphere_with_wide_holes_is_one_valid_chart(method, keywords, seed):
    p, f = shapes.icosphere(3)
    centres = np.random.default_rng(seed).normal(size=(4, 3))
    centres /= np.linalg.norm(centres, axis=1)[:, None]
    c = p[f].mean(1)
    shape = shapes.compact(p, f[~(c @ centres.T > 0.93).any(1)])
    result = circparam.unwrap(shape, method=method, cut="disk", **keywords)
    assert result.measures["flips"] == result.measures["overlap"] == 0
    assert result.measures["angle"] < 1.15  # with virtual faces over the holes bff reached 1.17
    cut_mesh, _ = patches_of(shape)
    assert len(cut_mesh.loops.chart) - cut_mesh.n_charts >= 2
