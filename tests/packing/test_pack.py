"""Packing from end to end: what is promised holds for any charts and options."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.monitor import Monitor
from circparam.errors import NoResultError, OptionError
from circparam.packing import pack
from circparam.packing.options import PackOptions
from tests.support.packing import QUICK, blobs, boxes, promise, triangles, vertices_of
from tests.support.shapes import areas


@settings(max_examples=12)
@given(
    n=st.integers(1, 12),
    seed=st.integers(0, 10**6),
    padding=st.integers(0, 7),
    resolution=st.sampled_from([96, 160, 256]),
    rotate=st.sampled_from(["free", "90", "none"]),
)
def test_padding_border_and_overlap_on_random_charts(n, seed, padding, resolution, rotate):
    faces, uv, chart = blobs(n, seed)
    options = PackOptions(resolution, padding, rotate, effort=QUICK)
    promise(faces, uv, chart, pack(faces, uv, chart, options), options)


class _Patient(Monitor):
    """Loops may go on for ever; what would be broken off is at its first step."""

    @property
    def expired(self) -> bool:
        return False


def test_a_packer_that_takes_too_long_is_broken_off_and_leaves_what_others_found():
    """Masks of many charts are made before the search first looks at the clock."""
    faces, uv, chart = blobs(25, 3)
    options = PackOptions(512, 4, effort=QUICK)
    monitor = _Patient(timeout=1.0)
    monitor.deadline = -1e9
    promise(faces, uv, chart, pack(faces, uv, chart, options, monitor), options)
    assert monitor.late


def test_charts_smaller_than_a_texel_do_not_overlap():
    """Specks cover no texel centre; their boxes are still apart by a texel's diagonal."""
    faces, uv, chart = blobs(3, 2)
    small, small_uv, small_chart = triangles(40, 4)
    uv2 = np.r_[uv, small_uv * 1e-4]
    faces2 = np.r_[faces, small + len(uv)]
    chart2 = np.r_[chart, small_chart + 3]
    packed = pack(faces2, uv2, chart2, PackOptions(256, 2, effort=QUICK))
    box = np.array(
        [[packed.uv[v].min(0), packed.uv[v].max(0)] for v in vertices_of(faces2, chart2)]
    )
    box = box[3:] * 256
    apart = np.maximum(box[:, None, 0] - box[None, :, 1], box[None, :, 0] - box[:, None, 1]).max(2)
    assert apart[~np.eye(40, dtype=bool)].min() > 1


@pytest.mark.parametrize("n", [2, 3, 6])
def test_a_page_packed_before_fits_at_its_sizes(n):
    """Packers reach less at fixed sizes; charts then stay where they lie, if that passes the check."""
    faces, uv, chart = blobs(n, 5)
    options = PackOptions(256, 2, effort=QUICK)
    before = pack(faces, uv, chart, options)
    fixed = PackOptions(256, 2, scale=False, effort=QUICK)
    after = pack(faces, before.uv, chart, fixed)
    assert after.scale == 1.0
    promise(faces, before.uv, chart, after, fixed)
    with pytest.raises(OptionError, match="resolution"):
        pack(faces, before.uv * 1.2, chart, fixed)


@pytest.mark.parametrize("n", [10, 300])
def test_more_pages_hold_larger_charts(n):
    faces, uv, chart = blobs(n, 9, 0.3)
    one = pack(faces, uv, chart, PackOptions(256, 1, effort=QUICK))
    options = PackOptions(256, 1, pages=3, effort=0.2)
    three = pack(faces, uv, chart, options)
    assert three.scale > 1.3 * one.scale
    assert set(three.page) >= {0, 1}
    assert three.share.shape == (3,)
    if n == 10:
        promise(faces, uv, chart, three, options)


def test_charts_that_do_not_fit_and_charts_without_area_alone_are_refused():
    with pytest.raises(OptionError, match="500 charts do not fit"):
        pack(*triangles(500, 1), PackOptions(64, 4))
    with pytest.raises(NoResultError):
        pack(np.array([[0, 1, 2]]), np.zeros((3, 2)), np.zeros(1, int))


def test_charts_without_area_are_kept_and_named():
    faces, uv, chart = blobs(3, 1)
    uv = np.r_[uv, [[0, 0], [1, 0], [2, 0]]]
    faces = np.r_[faces, [[len(uv) - 3, len(uv) - 2, len(uv) - 1]]]
    packed = pack(faces, uv, np.r_[chart, [3]], PackOptions(128, 2, effort=QUICK))
    assert "1 of 4 charts have no area" in packed.notes[0]
    line = packed.uv[-3:]
    assert np.ptp(line, axis=0).max() > 0


def test_inputs_are_untouched_and_mirrored_charts_stay_so():
    faces, uv, chart = blobs(4, 6)
    uv[:, 0] *= -1
    before = [x.copy() for x in (faces, uv, chart)]
    packed = pack(faces, uv, chart, PackOptions(128, 1, effort=QUICK))
    for x, y in zip(before, (faces, uv, chart), strict=True):
        assert np.array_equal(x, y)
    assert (areas(packed.uv[faces]) < 0).all()


def test_what_cannot_fit_at_a_density_is_told_at_once_with_the_pages_it_needs():
    """Ten squares of 100 texels on pages of 250, which hold four of them each at best."""
    faces, uv, chart = boxes(np.ones((10, 2)))
    packed = pack(faces, uv, chart, PackOptions(250, 4, pages=3, texel_density=100.0))
    assert int(packed.page.max()) + 1 == 3
    says = r"needs at least 2 pages of 250 texels: give --pages 2.*--texel-density below"
    with pytest.raises(OptionError, match=says) as told:
        pack(faces, uv, chart, PackOptions(250, 4, texel_density=100.0))
    below = float(str(told.value).split("below ")[1].split()[0])
    # at that density the areas alone would just do
    assert 10 * below**2 == pytest.approx((250 - 2 * 3.51) ** 2, rel=0.01)


def test_a_chart_longer_than_the_page_is_told_at_once():
    faces, long, chart = boxes([[40.0, 0.1]])
    with pytest.raises(
        OptionError, match=r"longest chart has .* raise --resolution to (\d+)"
    ) as told:
        pack(faces, long, chart, PackOptions(256, 4, texel_density=10.0))
    side = int(str(told.value).rsplit(" ", 1)[1])
    assert pack(faces, long, chart, PackOptions(side, 4, texel_density=10.0)).share[0] > 0


@pytest.mark.parametrize("density", [6.0, 8.0, 9.5, 11.0])
def test_small_pages_are_packed_or_refused_with_a_cure(density: float) -> None:
    """On pages of a few texels most of the side is border, and charts still keep their gap."""
    angle = 0.3
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.6]]) @ turn
    uv = np.concatenate([triangle, triangle @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + 5])
    faces, chart = np.arange(6).reshape(2, 3), np.array([0, 1])
    fitted = 0
    for side in range(16, 30):
        with contextlib.suppress(OptionError):
            pack(faces, uv, chart, PackOptions(side, 4, texel_density=density))
            fitted += 1
    assert fitted >= 5
