"""Charts cut for several pages, and for pages that are too small for them at a fixed texel density."""

from typing import Any

import pytest

from circparam.errors import OptionError
from circparam.pipeline.result import Result
from circparam.pipeline.unwrap import unwrap
from tests.support import shapes

QUICK = {"effort": 0.02, "resolution": 512, "jobs": 1}
BENT = shapes.half_cylinder()


def texels(result: Result) -> float:
    """Pages that are covered, in all."""
    pages, share = result.measures["pages"], result.measures["pack"]
    assert pages is not None
    assert share is not None
    return pages * share


def test_one_chart_is_cut_for_the_pages_asked_for() -> None:
    whole = unwrap(BENT, pages=4, pack_splits=0, **QUICK)
    assert (whole.measures["charts"], whole.measures["pages"]) == (1, 1)
    cut = unwrap(BENT, pages=4, **QUICK)
    assert cut.status == "ok"
    assert (cut.measures["pages"] or 0) > 2
    assert texels(cut) > 2 * texels(whole)
    assert any("to fill 4 pages" in note for note in cut.notes)


@pytest.mark.parametrize("keywords", [{"pack_splits": 1}, {"max_charts": 2}])
def test_no_more_cuts_than_asked_for(keywords: dict[str, Any]) -> None:
    result = unwrap(BENT, pages=4, **keywords, **QUICK)
    assert result.status == "ok"
    assert (result.measures["charts"] or 0) <= 2


def test_charts_longer_than_a_page_are_cut_to_fit_at_a_density() -> None:
    strip = shapes.grid(41, 5, 40.0, 4.0)
    with pytest.raises(OptionError, match="longest chart"):
        unwrap(strip, texel_density=20.0, pack_splits=0, **QUICK)
    result = unwrap(strip, texel_density=20.0, **QUICK)
    assert result.status == "ok"
    assert (result.measures["charts"] or 0) >= 2
    assert any("fit on a page" in note for note in result.notes)


def test_what_fits_at_a_density_is_not_cut() -> None:
    result = unwrap(BENT, texel_density=50.0, **QUICK)
    assert result.measures["charts"] == 1
