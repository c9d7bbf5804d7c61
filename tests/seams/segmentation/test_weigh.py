"""Weights on the faces that are stretched too much: a shorter tail without a seam."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.distortion import chart_distortion, face_stretch
from circparam.geometry.overlap import self_overlapping, signs
from circparam.seams.segmentation.weigh import Limits, relax_weighted, share_over
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of


def relaxed(shape):
    cut_mesh, _ = patches_of(shape)
    start, _ = tutte_embedding(cut_mesh, "mean-value")
    return cut_mesh, relax(cut_mesh, start, RelaxOptions(tolerance=1e-6)).uv


def tail(cut_mesh, uv, most):
    return share_over(cut_mesh, face_stretch(cut_mesh, uv), most)


@pytest.mark.parametrize("local", [None, 8])
@pytest.mark.parametrize("shape", [shapes.spiked_disk(400, 2.0), shapes.spiked_disk(4000, 2.0)])
def test_weights_shorten_the_tail_and_keep_to_the_bound(shape, local):
    cut_mesh, uv = relaxed(shape)
    most = 0.8 * float(np.quantile(face_stretch(cut_mesh, uv), 0.995)) + 0.2
    before = tail(cut_mesh, uv, most)
    bound = float(chart_distortion(cut_mesh, uv)[0]) * 1.05
    out, better = relax_weighted(cut_mesh, uv, Limits(bound, most, 0.0, local=local), Monitor())
    assert better.tolist() == [True]
    assert tail(cut_mesh, out, most)[0] < 0.7 * before[0]
    assert chart_distortion(cut_mesh, out)[0] <= bound
    assert (signs(out, cut_mesh.faces) > 0).all()
    assert not self_overlapping(cut_mesh, out).any()


def test_charts_that_are_good_stay_bit_by_bit():
    spike, flat = shapes.spiked_disk(400, 2.0), shapes.delaunay_disk(300)
    shape = shapes.join(spike, (flat[0] + [9, 0, 0], flat[1]))
    cut_mesh, uv = relaxed(shape)
    spiked = face_stretch(cut_mesh, uv)[cut_mesh.chart == 0]
    most = 0.8 * float(np.quantile(spiked, 0.995)) + 0.2
    out, better = relax_weighted(cut_mesh, uv, Limits(9.0, most, 0.0), Monitor())
    assert better.tolist() == [True, False]
    calm = cut_mesh.vertex_chart == 1
    assert np.array_equal(out[calm], uv[calm])
