"""Table 1 of the source: the meshes, the timing, and what the report says about the ratio."""

import numpy as np
import pytest

from circparam import errors
from circparam.compare import kim2019


@pytest.mark.parametrize("n", [8, *kim2019.PRINTED_TIMES])
def test_disks_have_exactly_so_many_vertices(n: int) -> None:
    cut_mesh = kim2019.bumped_disk(n)
    assert cut_mesh.n_vertices == n
    assert cut_mesh.n_charts == 1
    assert cut_mesh.euler().tolist() == [1]
    assert (cut_mesh.areas > 0).all()


def test_ratio_is_that_of_the_medians() -> None:
    *rows, own = kim2019.timed_sizes((60, 120, 50), repeats=3)
    assert (own.vertices, own.paper_ratio) == (50, None)
    assert [r.vertices for r in rows] == [60, 120]
    for r in rows:
        assert r.ratio == pytest.approx(r.floater.median / r.circle.median)
        assert r.paper_ratio == pytest.approx(
            kim2019.PRINTED_TIMES[r.vertices][1] / kim2019.PRINTED_TIMES[r.vertices][0]
        )
        for spread in (r.circle, r.floater, r.circle_weights, r.floater_weights):
            assert 0 < spread.low <= spread.median <= spread.high
        assert r.circle_weights.median < r.circle.median  # a stage is part of the whole
        assert r.as_dict()["circle"]["median"] == r.circle.median


def test_printed_range_is_that_of_the_printed_table() -> None:
    ratios = [floater / own for own, floater in kim2019.PRINTED_TIMES.values()]
    assert np.round([min(ratios), max(ratios)], 3).tolist() == list(kim2019.PRINTED_RATIOS)


@pytest.mark.parametrize(("sizes", "repeats"), [((5,), 3), ((), 3), ((60,), 0)])
def test_senseless_requests_are_refused(sizes: tuple[int, ...], repeats: int) -> None:
    with pytest.raises(errors.OptionError):
        kim2019.timed_sizes(sizes, repeats)
