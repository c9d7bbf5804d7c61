"""Long protrusions: where convex maps fail in double precision, and graded weights do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.distortion import measure
from circparam.solvers.tutte.boundary import TutteOptions
from circparam.solvers.tutte.embed import embed_convex
from circparam.solvers.tutte.graded import border_depth, embed, embed_start
from circparam.solvers.untangle import flipped
from tests.support import shapes
from tests.support.charts import patches_of, rim

LONG = shapes.tube(12.0, around=16)
# a border without symmetry: the tip of the tube does not come to lie at the origin, where numbers are densest
SKEW = TutteOptions(border="polygon", polygon=np.array([[0.0, 0.0], [3.0, 0.0], [1.0, 2.0]]))


def plain_map(patches, weights="circle"):
    return embed_convex(patches, weights, SKEW)[0]


@pytest.mark.parametrize("weights", ["circle", "mean-value", "floater", "uniform"])
def test_a_long_tube_flips_in_double_precision_and_is_mended_by_graded_weights(weights):
    patches, _ = patches_of(LONG)
    plain = plain_map(patches, weights)
    assert flipped(patches.faces, plain).any()  # else this test shows nothing
    uv, notes = embed(patches, weights, SKEW, Monitor())
    assert not flipped(patches.faces, uv).any()
    assert len(notes) == 1
    assert "too long for double precision" in notes[0]
    border = rim(patches)
    np.testing.assert_array_equal(uv[border], plain[border])


def test_charts_that_embed_are_left_exactly_as_they_are():
    tube, disk = LONG, shapes.bumped_disk(200)
    both = shapes.join(disk, (tube[0] + 50, tube[1]))
    patches, _ = patches_of(both)
    plain = plain_map(patches)
    uv, _ = embed(patches, "circle", SKEW, Monitor())
    assert not flipped(patches.faces, uv).any()
    calm = np.flatnonzero(
        [not flipped(patches.faces[patches.chart == c], plain).any() for c in (0, 1)]
    )
    assert len(calm) == 1
    own = patches.vertex_chart == calm[0]
    np.testing.assert_array_equal(uv[own], plain[own])


def test_a_crushed_tube_starts_from_the_weights_that_distort_least():
    patches, _ = patches_of(shapes.tube(5.0, around=16))
    plain, told = embed(patches, "circle", TutteOptions(), Monitor())
    assert told == []
    assert measure(patches, plain).sd > 1e9  # upright, and far too small to relax from
    uv, notes = embed_start(patches, "circle", TutteOptions(), Monitor())
    measured = measure(patches, uv)
    assert measured.flips == 0
    assert measured.sd < 1e4
    assert "graded" in notes[0]
    again, _ = embed_start(patches, "circle", TutteOptions(), Monitor())
    np.testing.assert_array_equal(uv, again)


def test_an_ordinary_start_is_the_plain_map_at_its_best_scale():
    patches, _ = patches_of(shapes.bumped_disk(200))
    uv, notes = embed_start(patches, "circle", TutteOptions(), Monitor())
    plain, _ = embed_convex(patches)
    scale = np.hypot(*uv.T).max() / np.hypot(*plain.T).max()
    np.testing.assert_allclose(uv, scale * plain, atol=1e-12)
    assert notes == []


def test_depth_counts_edges_from_the_outer_border():
    patches, points = patches_of(shapes.rings(4))
    depth = border_depth(patches)
    assert depth.max() == depth[np.argmin(np.abs(points).sum(1))] == 4
    assert (depth[rim(patches)] == 0).all()


def test_without_repair_the_flips_stay():
    patches, _ = patches_of(LONG)
    uv, notes = embed(patches, "circle", replace(SKEW, repair=False), Monitor())
    assert notes == []
    assert flipped(patches.faces, uv).any()
