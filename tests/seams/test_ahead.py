"""The stretch held beside merging on: the same as held after it, and never of what has changed since."""

import os
from collections.abc import Iterator

import numpy as np
import pytest

from circparam.core import workers
from circparam.core.monitor import Monitor
from circparam.core.pool import current
from circparam.mesh.atlas import Atlas
from circparam.seams import ahead
from circparam.seams.ahead import StretchAhead, hold_all
from circparam.seams.segmentation.weigh import Limits
from tests.support import shapes
from tests.support.atlases import relaxed

LIMITS = Limits(1.5, 2.0)


@pytest.fixture(autouse=True)
def one_process(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(ahead, "LEAST", 100)
    workers.start(2, "circparam.seams.charts")
    pool = current()
    assert pool is not None
    pool.ready.result()
    yield
    workers.stop()


def copy(atlas: Atlas) -> Atlas:
    return Atlas(atlas.surface, atlas.cut, atlas.corners)


def held(atlas: Atlas) -> Atlas:
    out = copy(atlas)
    hold_all(out, LIMITS, Monitor())
    return out


def same(a: Atlas, b: Atlas) -> bool:
    return np.array_equal(a.cut, b.cut) and np.array_equal(a.corners, b.corners)


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_was_begun_is_the_result_where_nothing_has_changed(
    jobs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    atlas, _ = relaxed(shapes.spire())
    expected = held(atlas)
    assert not same(atlas, expected), "there is something to hold"
    here: list[int] = []
    monkeypatch.setattr(ahead, "hold_all", lambda *a: here.append(os.getpid()) or hold_all(*a))
    stretch = StretchAhead(LIMITS, True, True, Monitor(jobs=jobs))
    stretch.begin(atlas)
    stretch.hold(atlas)
    assert same(atlas, expected)
    assert bool(here) == (jobs == 1), "the process has done it"


@pytest.mark.parametrize("what", ["cut", "corners"])
def test_an_atlas_that_has_changed_is_held_as_it_is_now(what: str) -> None:
    atlas, _ = relaxed(shapes.spire())
    stretch = StretchAhead(LIMITS, True, True, Monitor(jobs=2))
    stretch.begin(atlas)
    if what == "cut":
        atlas.cut = held(atlas).cut
    else:
        atlas.corners = atlas.corners @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    expected = held(atlas)
    stretch.hold(atlas)
    assert same(atlas, expected)
