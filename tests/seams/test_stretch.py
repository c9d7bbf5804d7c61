"""The stretch of the level of a large surface."""

import numpy as np

from circparam.core.monitor import Monitor
from circparam.geometry.distortion import face_stretch
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.weigh import share_over
from circparam.seams.stretch import STRETCH, stretch_held
from tests.support import shapes
from tests.support.atlases import relaxed


def test_a_level_is_held_in_an_atlas_of_its_own() -> None:
    """The spike is stretched too much; a copy is held until hardly a face of it is."""
    atlas, _ = relaxed(shapes.spiked_disk(400, 2.0))
    cut, corners = atlas.cut.copy(), atlas.corners.copy()
    held = stretch_held(atlas, 1.5, SeamOptions(), Monitor())
    opened = [one.open() for one in (atlas, held)]
    before, after = (share_over(m, face_stretch(m, uv), STRETCH).sum() for m, uv in opened)
    assert after <= 1e-3 < before
    assert np.array_equal(atlas.cut, cut)
    assert np.array_equal(atlas.corners, corners)
