"""Measures against maps whose distortion is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circparam.geometry.distortion import METRICS, Tail, best_chart_scales, face_stretch, measure
from circparam.mesh.cut_mesh import CutMesh
from tests.support import shapes
from tests.support.charts import patches_of


def flat(copies=1):
    cut_mesh, points = patches_of(shapes.row_of(shapes.delaunay_square(80), copies))
    return cut_mesh, points[:, :2]


@pytest.mark.parametrize("metric", METRICS.names())
def test_a_similarity_is_perfect(metric):
    cut_mesh, uv = flat()
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    m = measure(cut_mesh, 5 * uv @ turn.T + [100, -3])
    assert m.whole[metric] == pytest.approx(1, abs=1e-9)
    assert m.charts[metric][0] == pytest.approx(1, abs=1e-9)
    assert m.flips == 0
    assert m.scale == pytest.approx(0.2)


def test_two_charts_of_different_density_pay_for_it():
    cut_mesh, uv = flat(2)
    grown = uv * np.where(cut_mesh.vertex_chart == 1, 4.0, 1.0)[:, None]
    m = measure(cut_mesh, grown)
    # P k² + N/k² with P = (1 + 16)/2 · 2 and N = (1 + 1/16)/2 · 2 at its best scale, over 4
    assert m.sd == pytest.approx(2 * np.sqrt(17 * (1 + 1 / 16)) / 4)
    k = ((1 + 1 / 16) / 17) ** 0.25
    each = [(s**2 * k**2 + 1 / (s * k) ** 2) / 2 for s in (1, 4)]
    np.testing.assert_allclose(m.charts["sd"], each)
    assert m.sd_max_chart == pytest.approx(max(each))
    scales = best_chart_scales(cut_mesh, grown)
    np.testing.assert_allclose(scales, [1, 0.25])
    assert measure(cut_mesh, grown * scales[cut_mesh.vertex_chart][:, None]).sd == pytest.approx(1)


def test_a_face_without_a_shape_is_left_out():
    rest_triangles = np.array([[[0, 0], [1, 0], [0, 1]], [[0, 0], [1, 0], [0.5, 1e-14]]], float)
    cut_mesh = CutMesh(
        np.array([[0, 1, 2], [1, 0, 3]]), rest_triangles, np.array([0, 0]), np.array([[0, 3]])
    )
    m = measure(cut_mesh, np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5]], float))
    assert m.degenerate == 1
    assert m.flips == 0
    assert m.sd == pytest.approx(1)


@given(
    st.lists(st.tuples(st.floats(1, 9), st.floats(1e-3, 5)), min_size=1, max_size=40),
    st.floats(0.5, 99.9),
    st.floats(1, 10),
)
def test_the_tail_is_what_is_counted_face_by_face(faces, percent, most):
    stretch, area = (np.array(x) for x in zip(*faces, strict=True))
    tail = Tail.of(stretch, area)
    for value in (most, *stretch):  # what is just that is not over
        over = area[stretch > value].sum() / area.sum()
        assert tail.share_over(value) == pytest.approx(over, abs=1e-12)
    value = tail.percentile(percent)
    assert value in stretch
    # no more than so much lies above, and with anything less it would be more
    assert area[stretch > value].sum() <= (1 - percent / 100 + 1e-9) * area.sum()
    assert area[stretch >= value].sum() >= (1 - percent / 100 - 1e-9) * area.sum()
    expected = np.quantile(stretch, percent / 100, method="inverted_cdf", weights=area)
    at = np.searchsorted(np.sort(stretch), [value, expected])
    assert abs(at[0] - at[1]) <= 1  # where the share is met exactly, rounding decides
    none = Tail.of(stretch[:0], area[:0])
    assert (none.percentile(percent), none.share_over(most)) == (1, 0)


@pytest.mark.parametrize("scales", [(2.0, 0.5), (2.0, 1.0), (1.0, 0.25)])
def test_the_stretch_of_a_linear_map_is_that_of_its_worse_direction(scales):
    cut_mesh, uv = flat()
    large, small = max(scales), min(scales)
    # P k² + N / k² is least at k⁴ = N / P
    k = ((large**-2 + small**-2) / (large**2 + small**2)) ** 0.25
    worst = max(large * k, 1 / (small * k))
    m = measure(cut_mesh, 7 * uv * scales)
    for percent in (95, 99, 99.9):
        assert m.tail.percentile(percent) == pytest.approx(worst)
    assert m.tail.share_over(worst * 0.999) == pytest.approx(1)
    assert m.tail.share_over(worst * 1.001) == 0
    np.testing.assert_allclose(face_stretch(cut_mesh, 7 * uv * scales), worst)


def test_uv_in_one_point_are_infinitely_bad_whatever_the_size_of_the_mesh() -> None:
    """Not NaN, and no number overflows on the way."""
    for size in (1e-12, 1.0, 1e12):
        p, f = shapes.grid(2, 2)
        patch, _ = patches_of((size * p, f))
        uv = np.zeros((patch.n_vertices, 2))
        assert measure(patch, uv).charts["sd"][0] > 1e50
        assert np.isfinite(best_chart_scales(patch, uv)).all()
