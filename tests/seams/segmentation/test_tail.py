"""The tail of the distortion: all but 0.1 % of the surface keep to the stretch that is asked for."""

import dataclasses

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.distortion import Tail, face_stretch
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import FINAL
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.tail import limit_stretch
from circparam.seams.segmentation.weigh import Limits
from circparam.seams.stretch import STRETCH, stretch_held
from circparam.solvers.newton import relax
from tests.support import shapes
from tests.support.atlases import (
    assert_promises,
    charts_of,
    energies,
    middles,
    relaxed,
    surface_of,
    voronoi,
)

SPIKE = shapes.spiked_disk(400, 2.0)
TUBE = shapes.tube(3.0)


def share_over(atlas, most):
    cut_mesh, uv = atlas.open()
    return Tail.of(face_stretch(cut_mesh, uv), cut_mesh.areas).share_over(most)


def fewest(shape):
    """As few charts as the bound allows, whatever their distortion costs: with a tail."""
    atlas = voronoi(shape, 12)
    merge(atlas, MergeOptions(1.05, chart=np.inf), Monitor())
    cut_mesh, uv = atlas.open()
    atlas.scatter(cut_mesh, relax(cut_mesh, uv, FINAL).uv)
    return atlas


def held(loose, most, seams=True, bound=1.05, **how):
    atlas = Atlas(loose.surface, loose.cut, loose.corners)
    limit_stretch(atlas, Limits(bound, most, **how), Monitor(), seams=seams)
    return atlas


@pytest.mark.parametrize("local", [None, 8])
@pytest.mark.parametrize(("room", "left"), [(1.02, 0.8), (1.001, 1.0)])
def test_weights_shorten_the_tail_as_far_as_the_bound_allows(room, left, local):
    """To a bound so many times the distortion there is; the share that is left of the tail."""
    loose = fewest(SPIKE)
    most = 0.8 * float(np.quantile(face_stretch(*loose.open()), 0.995)) + 0.2
    bound = room * float(energies(*loose.open()).max())
    better = held(loose, most, seams=False, bound=bound, allowed=0.0, local=local)
    assert share_over(better, most) <= left * share_over(loose, most)
    assert_promises(better, bound)


def test_weights_alone_hold_the_default():
    loose = fewest(SPIKE)
    better = held(loose, 2.0)
    assert share_over(loose, 2.0) > 1e-3  # there is something to do
    assert share_over(better, 2.0) <= 1e-3
    assert np.array_equal(loose.cut, better.cut)
    assert_promises(better, 1.05)


DRAFT = {"local": 8, "cuts_off": True}  # parts are cut off


@pytest.mark.parametrize(
    ("shape", "most", "how"),
    [
        *((shape, most, how) for how in ({}, DRAFT) for shape, most in (
            (SPIKE, 1.5), (TUBE, 1.5), (TUBE, 1.25), (shapes.icosphere(3), 1.25),
        )),
        # one remedy alone does not help: halves of a torus are stretched like the whole, and a chart that is
        # all tip has nothing to cut off
        (shapes.torus(24, 12), 1.25, {}),
        (shapes.cube(6), 1.5, {}),
        (shapes.icosphere(3), 1.15, DRAFT | {"asked": True}),
        (shapes.bumpy(3), 1.25, DRAFT | {"asked": True}),
        (shapes.cube(6), 1.15, DRAFT | {"asked": True}),
    ],
)  # fmt: skip
def test_seams_hold_what_weights_cannot(shape, most, how):
    loose = fewest(shape)
    better = held(loose, most, **how)
    assert share_over(loose, most) > 1e-3
    assert share_over(better, most) <= 1e-3
    assert better.seam_length > loose.seam_length
    assert_promises(better, 1.05)


@pytest.mark.parametrize(("locked", "how"), [(True, {}), (True, DRAFT), (False, {"seams": False})])
def test_no_seam_is_added_where_none_may_be(locked, how):
    loose = fewest(SPIKE)
    loose.surface.locked[~loose.cut] = locked
    better = held(loose, 1.5, **how)
    assert np.array_equal(loose.cut, better.cut)
    assert_promises(better, 1.05)


def test_what_is_left_where_a_flat_goes_with_a_tip_keeps_to_the_bound():
    """The flat round the spike is one polygon, with faces that are stretched too much: it is cut off whole."""
    loose = fewest(SPIKE)
    flat = middles(loose.surface)[:, 2] < 0.01
    loose.surface.locked[:] = flat[loose.surface.edges // 3].all(1) & ~loose.cut
    better = held(loose, 1.5, **DRAFT)
    assert share_over(better, 1.5) <= 1e-3
    assert_promises(better, 1.05)


def test_a_chart_without_a_tail_stays_whole_beside_one_that_is_split():
    points, faces = shapes.grid(7, 7)
    loose = fewest(shapes.join(TUBE, (points + np.array([20.0, 0, 0]), faces)))
    better = held(loose, 1.5)
    assert better.charts()[0] > loose.charts()[0]
    far = middles(better.surface)[:, 0] > 15
    assert not better.cut[far[better.surface.edges[:, 0] // 3]].any()
    assert np.array_equal(better.corners[far], loose.corners[far]), "it stays bit by bit"


def test_charts_are_not_split_where_their_number_counts():
    surface = surface_of(*SPIKE)
    assert charts_of(surface, max_stretch=1.2).charts()[0] > 1
    assert charts_of(surface, max_stretch=1.2, max_charts=1).charts()[0] == 1


@pytest.mark.parametrize("how", [{}, DRAFT])
def test_a_tail_that_is_not_worth_its_seams_is_left_unless_a_user_asked(how):
    """The same part of a surface of a million times the area: its tail is a millionth as much of the whole."""
    loose = fewest(SPIKE)
    loose.surface = dataclasses.replace(loose.surface, whole_area=1e6 * loose.surface.areas.sum())
    left = held(loose, 1.5, **how)
    assert np.array_equal(left.cut, loose.cut)
    assert share_over(left, 1.5) > 1e-3
    asked = held(loose, 1.5, asked=True, **how)
    assert share_over(asked, 1.5) <= 1e-3


def test_a_level_is_held_in_an_atlas_of_its_own() -> None:
    """The spike is stretched too much; a copy is held until hardly a face of it is."""
    atlas, _ = relaxed(shapes.spiked_disk(400, 2.0))
    cut, corners = atlas.cut.copy(), atlas.corners.copy()
    better = stretch_held(atlas, 1.5, SeamOptions(), Monitor())
    assert share_over(better, STRETCH) <= 1e-3 < share_over(atlas, STRETCH)
    assert np.array_equal(atlas.cut, cut)
    assert np.array_equal(atlas.corners, corners)
