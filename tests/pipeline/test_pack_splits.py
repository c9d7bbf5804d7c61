"""Cuts that were asked for (--pack-splits N), cuts for several pages, and for a fixed density."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circparam
from circparam.errors import OptionError
from circparam.pipeline.page_cuts import extents, turned
from circparam.pipeline.result import Result
from circparam.pipeline.unwrap import unwrap
from tests.support import shapes


def star(arms: int = 4, length: int = 24, width: int = 4) -> shapes.Shape:
    """A flat cross (or a bar: two arms) of unit squares: arms of a width on a square hub."""
    n = 2 * length + width
    p, f = shapes.grid(n + 1, n + 1, n, n)
    middle = p[f].mean(1) - n / 2
    upright = np.abs(middle[:, 0]) < width / 2
    level = np.abs(middle[:, 1]) < width / 2
    return shapes.compact(p, f[level | upright] if arms == 4 else f[level])


@pytest.mark.parametrize(("most", "seed"), [(1, None), (4, 1)])
def test_arms_come_off_a_hub(most: int, seed: int | None, tmp_path: Path) -> None:
    """Whatever the order of its faces, so wherever its boundary begins: the corners of the hub are tried."""
    shape = star() if seed is None else shapes.shuffled(*star(), seed)[:2]
    whole = circparam.unwrap(shape, resolution=512)
    split = circparam.unwrap(shape, tmp_path / "o.obj", resolution=512, pack_splits=most)
    assert (whole.measures["charts"], split.status) == (1, "ok")
    assert 2 <= split.measures["charts"] <= 1 + most
    assert split.measures["pack"] >= 1.05 ** (split.measures["charts"] - 1) * whole.measures["pack"]
    # two halves of a cross fit into a square of side 33, the cross itself into one of 40: (40 / 33)² = 1.47
    assert split.measures["pack"] >= 1.4 * whole.measures["pack"]
    assert split.measures["gap_texels"] is None or split.measures["gap_texels"] >= 5
    # an arm is 4 wide and 24 long, the diagonal of the hub 8 along the edges: no cut runs along an arm
    added = split.measures["seam_length"] * np.sqrt(4 * 24 * 4 + 16)
    assert added <= (split.measures["charts"] - 1) * 12 + 1e-9
    cuts = split.measures["charts"] - 1
    note = next(n for n in split.notes if "fuller page" in n)
    assert note.startswith(f"{cuts} cut")
    assert f"{split.measures['seam_length']:.2f} roots of the area long" in note


def test_more_splits_fill_the_page_more() -> None:
    """Wide arms: boxes free nothing (a cross fits its box best when turned), pages do at once."""
    whole, one, four = (
        circparam.unwrap(star(width=5), resolution=512, pack_splits=most).measures
        for most in (0, 1, 4)
    )
    assert (whole["charts"], one["charts"]) == (1, 2)
    assert 3 <= four["charts"] <= 5
    assert one["pack"] >= 1.3 * whole["pack"]
    assert four["pack"] >= 1.5 * one["pack"]


def test_cuts_that_were_asked_for_are_made_beside_many_small_charts() -> None:
    """Twenty scraps have a fifth of the area: no reason to leave the cross alone."""
    scraps = [shapes.grid(2, 2, 2.4, 2.4) for _ in range(20)]
    apart = [(p + np.array([80.0 + 3 * k, 0.0, 0.0]), f) for k, (p, f) in enumerate(scraps)]
    parts = shapes.join(star(), *apart)
    whole, split = (circparam.unwrap(parts, resolution=512, pack_splits=n) for n in (0, 2))
    assert whole.measures["charts"] == 21
    assert 22 <= split.measures["charts"] <= 23
    assert split.measures["pack"] > whole.measures["pack"]


def test_nothing_is_split_that_packs_well() -> None:
    plain = circparam.unwrap(shapes.delaunay_square(200), resolution=256)
    result = circparam.unwrap(shapes.delaunay_square(200), resolution=256, pack_splits=3)
    assert result.measures["charts"] == 1
    assert np.array_equal(result.uv, plain.uv)
    assert any("no cut is worth its seam" in note for note in result.notes)


QUICK = {"effort": 0.02, "resolution": 512, "jobs": 1}
BENT = shapes.half_cylinder()


def texels(result: Result) -> float:
    """Pages that are covered, in all."""
    pages, share = result.measures["pages"], result.measures["pack"]
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


@given(st.integers(0, 10**6))
def test_stretches_of_a_boundary_have_the_least_boxes_and_squares_of_their_points(seed):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(int(rng.integers(6, 40)), 2))
    pick = np.sort(rng.choice(len(p), int(rng.integers(2, min(len(p), 12))), replace=False))
    first, pieces = np.divmod(np.arange(len(pick) * (len(pick) - 1)), len(pick) - 1)
    pieces = pieces + 1
    box, square = extents(p, pick, first, pieces)
    around = np.r_[pick, pick + len(p)]
    for k, (i, n) in enumerate(zip(first.tolist(), pieces.tolist(), strict=True)):
        points = turned(p[np.arange(around[i], around[i + n] + 1) % len(p)])
        size = np.ptp(points, axis=0)
        assert np.isclose(box[k], size.prod(1).min())
        assert np.isclose(square[k], size.max(1).min())
