"""Small charts that join their neighbours, or stay as they were."""

import numpy as np

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import ROUGH
from circparam.seams.moves.glue import MergeOptions
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.small import absorb
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, judged, middles, surface_of


def straddled() -> Atlas:
    """A sphere in two charts and a third, of a few faces, across the seam between them."""
    surface = surface_of(*shapes.icosphere(3))
    middle = middles(surface)
    label = (middle[:, 2] > 0).astype(np.int64)
    label[np.linalg.norm(middle - [1.0, 0, 0], axis=1) < 0.25] = 2
    atlas = cut_between(surface, label)
    assert atlas.charts()[0] == 3
    lay_out_fresh(atlas, None, ROUGH)
    return atlas


def test_small_charts_join_their_neighbours_face_by_face() -> None:
    atlas = straddled()
    few = int(np.bincount(atlas.charts()[1]).min())
    assert absorb(atlas, MergeOptions(1.6, chart=np.inf), few, Monitor()) == 0
    assert atlas.charts()[0] == 3, "as large as asked already"
    # the two halves alone would close to a sphere: the bound keeps them apart
    assert absorb(atlas, MergeOptions(1.6, chart=np.inf), few + 1, Monitor()) == 0
    n, chart = atlas.charts()
    assert np.bincount(chart).min() > few
    assert n == 2
    assert not judged(atlas).bad(1.6).any()


def test_small_charts_that_nobody_takes_stay_as_they_were() -> None:
    atlas = straddled()
    before = atlas.cut.copy()
    few = int(np.bincount(atlas.charts()[1]).min())
    assert absorb(atlas, MergeOptions(1.0001, chart=np.inf), few + 1, Monitor()) == 1
    assert np.array_equal(atlas.cut, before)


def test_charts_with_a_neighbour_count_as_small_below_the_number_asked_for() -> None:
    """Not those that are alone, however small they are; flat ones join whatever lies beside them."""
    sheet = shapes.grid(7, 3, 6.0, 1.0)
    alone = shapes.triangle()
    surface = surface_of(*shapes.join(sheet, (alone[0] + np.array([9.0, 0, 0]), alone[1])))
    x = middles(surface)[:, 0]
    label = np.where(x > 8, 2, (x > 5).astype(np.int64))
    for least, charts in ((4, 3), (5, 2), (20, 2)):
        atlas = as_it_lies(cut_between(surface, label))
        assert np.sort(np.bincount(atlas.charts()[1])).tolist() == [1, 4, 20]
        assert absorb(atlas, MergeOptions(1.05, chart=np.inf), least, Monitor()) == 0
        assert atlas.charts()[0] == charts
    atlas = as_it_lies(cut_between(surface, label))
    assert absorb(atlas, MergeOptions(1.05, chart=np.inf), 5, Monitor(timeout=0.0)) == 1, (
        "no time: it stays"
    )
    assert atlas.charts()[0] == 3
