"""Seams decided from several starts: which of them are gone on with."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.seams.cost import COST
from circparam.seams.hard.regions import seam_prices
from circparam.seams.segmentation import decide as module
from circparam.seams.segmentation import starts
from circparam.seams.segmentation.layout import judge, lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import cut_between, middles, surface_of

MERGING = MergeOptions(1.05, margin=0.004)


@pytest.mark.parametrize(("behind", "most"), [(0.0, 1), (1e9, 4)])
def test_starts_that_are_behind_when_they_have_merged_are_given_up(
    monkeypatch: pytest.MonkeyPatch, behind: float, most: int
) -> None:
    surface = surface_of(*shapes.icosphere(3))
    cost: dict[int, float] = {}
    gone_on: list[float] = []
    start, end = starts.grow_and_merge, starts.shortened_and_merged

    def started(*task: object) -> starts.Start:
        one = start(*task)
        cost[len(cost)] = COST.seams(one.merger.atlas)
        return one

    def shortened(one: starts.Start, *rest: object) -> Atlas:
        gone_on.append(COST.seams(one.merger.atlas))
        return end(one, *rest)

    monkeypatch.setattr(starts, "BEHIND", behind)
    monkeypatch.setattr(starts, "TOGETHER", 0)
    monkeypatch.setattr(starts, "grow_and_merge", started)
    monkeypatch.setattr(starts, "shortened_and_merged", shortened)
    atlas = starts.best_of_starts(surface, MERGING, Worker(1), Monitor())
    assert len(cost) == 4
    assert len(set(cost.values())) > 1
    assert len(gone_on) == most
    assert min(gone_on) == min(cost.values())
    assert COST.seams(atlas) <= min(gone_on)
    assert np.isfinite(atlas.corners).all()


def test_only_the_best_of_the_starts_is_shortened_a_second_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    surface = surface_of(*shapes.icosphere(3))
    rings: list[int] = []
    before: list[float] = []
    shorten = starts.shorten_seams

    def counted(atlas: Atlas, bound: float, options: RelaxOptions, reach: int, **rest: float):
        rings.append(reach)
        before.append(COST.seams(atlas))
        return shorten(atlas, bound, options, reach, **rest)

    ends: list[float] = []
    first = starts.shortened_and_merged

    def shortened(*given: object) -> Atlas:
        atlas = first(*given)
        ends.append(COST.seams(atlas))
        return atlas

    monkeypatch.setattr(starts, "BEHIND", 1e9)
    monkeypatch.setattr(starts, "shorten_seams", counted)
    monkeypatch.setattr(starts, "shortened_and_merged", shortened)
    atlas = starts.best_of_starts(surface, MERGING, Worker(1), Monitor())
    assert rings == [3, 3, 3, 3, 1]
    assert before[-1] == min(ends)
    assert COST.seams(atlas) <= min(ends)


def test_starts_that_merge_together_come_to_what_each_comes_to_alone() -> None:
    points, faces = shapes.icosphere(3)
    surface = surface_of(points * (1 + 0.3 * np.sin(3 * points[:, :1])), faces)
    seeds = [40, 12, 25]
    found = starts.merged_together(surface, MERGING, seeds, Monitor())
    cuts = []
    for one, k in zip(found, seeds, strict=True):
        alone = starts.grow_and_merge(surface, MERGING, k, None, Monitor()).merger
        np.testing.assert_array_equal(one.merger.atlas.cut, alone.atlas.cut)
        np.testing.assert_allclose(one.merger.atlas.corners, alone.atlas.corners, atol=1e-6)
        np.testing.assert_allclose(one.merger.lower_bound, alone.lower_bound, atol=1e-6)
        np.testing.assert_array_equal(one.merger.failed.overlapped, alone.failed.overlapped)
        cuts.append(alone.atlas.cut.sum())
    assert len(set(cuts)) > 1


def test_a_start_goes_on_as_it_would_have_in_one_piece() -> None:
    """Merging and shortening in two calls, with what was learnt handed on, by copy or not."""
    import pickle

    surface = surface_of(*shapes.icosphere(3))
    one = starts.grow_and_merge(surface, MERGING, 12, None, Monitor())
    copy = pickle.loads(pickle.dumps(one, 5))
    assert len(one.merger.tried) > 0
    here = starts.shorten_once(one, Monitor())
    there = starts.shorten_once(copy, Monitor())
    for a, b in zip(here, there, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("hard", [True, False])
def test_where_a_round_finds_nothing_on_a_hard_surface_no_other_is_made(hard, monkeypatch) -> None:
    surface = surface_of(*shapes.cylinder(around=12, along=4, caps=True))
    chart = (middles(surface)[:, :2] > 0) @ [1, 2]
    atlas = cut_between(surface, chart)
    lay_out_fresh(atlas, None, RelaxOptions(tolerance=1e-3, max_iterations=25))
    if hard:
        atlas.prices = seam_prices(surface)
    rounds = []

    def barren(self: Merger, monitor: Monitor) -> bool:
        rounds.append(1)
        self.work += 10 * module.BARREN
        self.limit = np.inf
        return len(rounds) < 5

    monkeypatch.setattr(Merger, "round", barren)
    module.merge_on(atlas, 1.05, 0.002, Monitor())
    assert len(rounds) == (1 if hard else 5)


def bumped_ring(height: float) -> tuple[np.ndarray, np.ndarray]:
    """A sheet with a hole in its right half and a hill in its left one."""
    points, faces = shapes.grid(61, 45)
    middle = points[faces].mean(1)
    hole = (np.abs(middle[:, 0] - 0.7) < 0.1) & (np.abs(middle[:, 1] - 0.5) < 0.2)
    used, index = np.unique(faces[~hole], return_inverse=True)
    points = points[used]
    far = (points[:, :2] - [0.1, 0.5]) ** 2
    points[:, 2] = height * np.exp(-far.sum(1) / (2 * 0.15**2))
    return points, index.reshape(-1, 3)


@pytest.mark.parametrize("stretch", [1.0, 1.1])
def test_charts_of_a_proxy_merge_as_if_they_were_relaxed(stretch: float) -> None:
    """A layout that is no minimum must neither hide what fits nor, when it is one, pay for what does not."""
    surface = surface_of(*bumped_ring(0.3))
    halves = cut_between(surface, (middles(surface)[:, 1] > 0.5).astype(np.int64))
    laid = lay_out_fresh(halves, None, RelaxOptions(tolerance=1e-8, max_iterations=60))
    area, least = laid.cut_mesh.chart_areas, laid.energy
    rough = Atlas(surface, halves.cut, halves.corners * [stretch, 1 / stretch])
    was = judge(*rough.open()).energy
    given = rough.corners.copy()
    out = module.merged_on(rough, 1.05, Monitor())
    np.testing.assert_array_equal(rough.corners, given)
    after = judge(*out.open())
    mean = np.average(after.energy, weights=after.cut_mesh.chart_areas)
    assert not after.bad(1.05).any()
    assert mean <= (1 + module.RISE) * np.average(was, weights=area)
    assert out.seam_length <= rough.seam_length
    # what is saved by relaxing pays for one chart, which costs three times as much as may be added
    assert mean <= (1 + 4 * module.RISE) * np.average(least, weights=area)
    assert out.charts()[0] == (2 if stretch == 1 else 1)


def test_one_piece_is_left_alone() -> None:
    surface = surface_of(*bumped_ring(0.3))
    whole = Atlas(surface, np.zeros(len(surface.edges), bool))
    assert module.merged_on(whole, 1.05, Monitor()) is whole


@pytest.mark.parametrize(
    ("level", "pieces", "alone", "shared"),
    [(2, 1, True, True), (4, 1, False, False), (3, 2, False, True), (3, 2, True, False)],
)
def test_starts_merge_alone_on_surfaces_in_one_piece_that_are_not_tiny(
    level: int, pieces: int, alone: bool, shared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    surface = surface_of(*shapes.row_of(shapes.icosphere(level), pieces))
    called: list[str] = []
    for name in ("merged_together", "start_once"):

        def noted(*task: object, way: str = name, done: object = getattr(starts, name)) -> object:
            called.append(way)
            assert callable(done)
            return done(*task)

        monkeypatch.setattr(starts, name, noted)
    starts.best_of_starts(surface, MERGING, Worker(1), Monitor(), None, alone)
    assert set(called) == ({"merged_together"} if shared else {"start_once"})
