"""Long protrusions: where convex maps fail in double precision, and graded weights do not."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.distortion import at_best_scales, measure
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.tutte.graded import embed, embed_start
from circparam.solvers.tutte.outer import TutteOptions
from circparam.solvers.untangle import flipped
from tests.support import shapes
from tests.support.charts import patches_of, rim

LONG = shapes.tube(12.0, around=16)
# a boundary without symmetry: the tip of the tube does not come to lie at the origin, where numbers are densest
SKEW = TutteOptions(boundary="polygon", polygon=np.array([[0.0, 0.0], [3.0, 0.0], [1.0, 2.0]]))


def plain_map(cut_mesh, weights="circle"):
    return tutte_embedding(cut_mesh, weights, SKEW)[0]


@pytest.mark.parametrize("weights", ["circle", "mean-value", "floater", "uniform"])
def test_a_long_tube_flips_in_double_precision_and_is_mended_by_graded_weights(weights):
    cut_mesh, _ = patches_of(LONG)
    plain = plain_map(cut_mesh, weights)
    assert flipped(cut_mesh.faces, plain).any()  # else this test shows nothing
    uv, notes = embed(cut_mesh, weights, SKEW, Monitor())
    assert not flipped(cut_mesh.faces, uv).any()
    assert len(notes) == 1
    assert "too long for double precision" in notes[0]
    boundary = rim(cut_mesh)
    np.testing.assert_array_equal(uv[boundary], plain[boundary])


def test_charts_that_embed_are_left_exactly_as_they_are():
    tube, disk = LONG, shapes.bumped_disk(200)
    both = shapes.join(disk, (tube[0] + 50, tube[1]))
    cut_mesh, _ = patches_of(both)
    plain = plain_map(cut_mesh)
    uv, _ = embed(cut_mesh, "circle", SKEW, Monitor())
    assert not flipped(cut_mesh.faces, uv).any()
    calm = np.flatnonzero(
        [not flipped(cut_mesh.faces[cut_mesh.chart == c], plain).any() for c in (0, 1)]
    )
    assert len(calm) == 1
    own = cut_mesh.vertex_chart == calm[0]
    np.testing.assert_array_equal(uv[own], plain[own])


def test_a_crushed_tube_starts_from_the_weights_that_distort_least():
    cut_mesh, _ = patches_of(shapes.tube(5.0, around=16))
    plain, told = embed(cut_mesh, "circle", TutteOptions(), Monitor())
    assert told == []
    assert measure(cut_mesh, plain).sd > 1e9  # upright, and far too small to relax from
    uv, notes = embed_start(cut_mesh, "circle", TutteOptions(), Monitor())
    measured = measure(cut_mesh, uv)
    assert measured.flips == 0
    assert measured.sd < 1e4
    assert "graded" in notes[0]
    again, _ = embed_start(cut_mesh, "circle", TutteOptions(), Monitor())
    np.testing.assert_array_equal(uv, again)


def test_flips_that_are_to_stay_do_not_make_a_poor_start():
    """Negative weights fold the map a little; nothing of it is collapsed."""
    cut_mesh, _ = patches_of(shapes.noisy(*shapes.bumped_disk(300), amount=0.4))
    plain, told = embed(cut_mesh, "harmonic", TutteOptions(repair=False), Monitor())
    assert flipped(cut_mesh.faces, plain).any()
    uv, notes = embed_start(cut_mesh, "harmonic", TutteOptions(repair=False), Monitor())
    np.testing.assert_array_equal(uv, at_best_scales(cut_mesh, plain))
    assert notes == told
