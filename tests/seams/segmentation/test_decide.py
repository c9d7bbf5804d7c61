"""Seams decided on one surface."""

from circparam.seams.segmentation import decide
from tests.support import shapes
from tests.support.atlases import uncut


def test_a_component_stays_whole_where_it_is_a_good_chart() -> None:
    """A ball with a pinhole needs a seam; a cap of it needs none."""
    points, faces = shapes.icosphere(4)
    height = points[faces][:, :, 2].max(1)
    cap, ball = uncut(points, faces[height > 0.7]), uncut(points, faces[height > -0.95])
    assert decide.whole_components(cap, 1.05).all()
    assert not decide.whole_components(ball, 1.05).any()
