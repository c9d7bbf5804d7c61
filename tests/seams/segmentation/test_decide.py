"""Seams decided on one surface."""

from dataclasses import replace

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.surface import Surface
from circparam.seams.cost import COST
from circparam.seams.moves.glue import MergeOptions
from circparam.seams.options import Search
from circparam.seams.segmentation import decide, starts
from circparam.seams.segmentation.layout import judge
from tests.support import shapes
from tests.support.atlases import surface_of, uncut

MERGING = MergeOptions(1.05, margin=0.004)


def bumpy() -> Surface:
    points, faces = shapes.icosphere(3)
    return surface_of(points * (1 + 0.3 * np.sin(3 * points[:, :1])), faces)


@pytest.mark.parametrize("draw", range(3))
def test_each_search_ends_in_charts_below_the_bound(draw: int) -> None:
    """The cheapest of its starts."""
    surface, merging = bumpy(), replace(MERGING, search=Search(draw=draw))
    regions = [k for _, k in starts.starts_of(merging.search, surface)]
    atlas = starts.searched(surface, merging, regions, Worker(1), Monitor())
    assert not judge(*atlas.open()).bad(MERGING.bound).any()
    each = [starts.grow_and_merge(surface, merging, k, None, Monitor()) for k in regions]
    assert COST.seams(atlas) == min(COST.seams(one) for one in each)


def test_a_boundary_stretches_by_the_isoperimetric_inequality_at_least() -> None:
    square, half = uncut(*shapes.grid(5, 5)), uncut(*shapes.hemisphere(24))
    least = decide.least_rim_stretch(square.cut_mesh())
    np.testing.assert_allclose(least, np.sqrt(4 * np.pi) / 4)
    np.testing.assert_allclose(decide.least_rim_stretch(half.cut_mesh()), np.sqrt(2), rtol=0.01)
    assert np.isinf(decide.least_rim_stretch(uncut(*shapes.icosphere(1)).cut_mesh())).all()


def test_components_stay_whole_where_their_boundary_is_wide_enough(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A ball with a pinhole is not laid out; a cap of it is, and is one chart."""
    points, faces = shapes.icosphere(4)
    height = points[faces][:, :, 2].max(1)
    cap, ball = uncut(points, faces[height > 0.7]), uncut(points, faces[height > -0.95])
    assert decide.whole_components(cap, 1.05).all()
    laid_out: list[int] = []
    real = decide.lay_out_fresh

    def recorded(*given, **options):
        laid_out.append(1)
        return real(*given, **options)

    monkeypatch.setattr(decide, "lay_out_fresh", recorded)
    assert not decide.whole_components(ball, 1.05).any()
    assert not laid_out
