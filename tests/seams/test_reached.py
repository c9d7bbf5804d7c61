"""A search that runs out of time gives what it has reached; a longer time never gives a worse answer."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.errors import OutOfTimeError
from circparam.formats.memory import from_arrays
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.pipeline.options import Options
from circparam.pipeline.result import Result
from circparam.pipeline.unwrap import unwrap_document
from circparam.seams.reached import Reached, in_time
from tests.support import parts, shapes
from tests.support.atlases import cut_between, middles, surface_of
from tests.support.clock import Clock

FRACTIONS = (0.1, 0.4, 1.1)


def assembly() -> tuple[np.ndarray, np.ndarray]:
    """Parts of a machine beside a rough ball: some are charted by their flats, some are grown."""
    ball, faces = shapes.icosphere(2)
    ball = ball * (1 + 0.3 * np.sin(5 * ball[:, :1]))
    pieces = [(p.points, p.faces) for p in (parts.bracket(), parts.letters())]
    pieces.append((ball, faces))
    return shapes.join(*((p + np.array([4.0 * k, 0, 0]), f) for k, (p, f) in enumerate(pieces)))


@pytest.fixture
def run(clock: Clock) -> Callable[[float], tuple[Result, int]]:
    """Unwraps the assembly by a clock that counts its calls: (result, how many)."""
    clock.step = 1.0
    document = from_arrays(*assembly())

    def unwrapped(limit: float) -> tuple[Result, int]:
        clock.now = 0.0
        options = Options(jobs=1, effort=1, pack_splits=0)
        return unwrap_document(document, None, options, Monitor(timeout=limit)), int(clock.now)

    return unwrapped


def test_what_was_reached_is_given_and_a_longer_limit_is_never_worse(run):
    whole, steps = run(1e9)
    assert not any("projected" in line for line in whole.repairs)
    cost = np.inf
    for fraction in FRACTIONS:
        result, _ = run(fraction * steps)
        assert not any("projected" in line for line in result.repairs), fraction
        assert result.status != "degraded", fraction
        now = float(result.measures["seam_length"] or 0) + 0.25 * int(
            result.measures["charts"] or 0
        )
        assert now <= 1.02 * cost, fraction
        cost = min(cost, now)
    assert np.array_equal(result.uv, whole.uv)


def two_balls() -> Surface:
    points, faces = shapes.icosphere(1)
    return surface_of(*shapes.join((points, faces), (points + 5, faces)))


def halved(surface: Surface, extra: int = 0) -> Atlas:
    """Every ball cut in two along its equator, some edges more of the first face."""
    cut = cut_between(surface, middles(surface)[:, 2] % 5 > 2).cut
    cut[np.flatnonzero(~cut)[:extra]] = True
    uv = np.random.default_rng(extra).random((surface.faces.max() + 1, 2))
    return Atlas(surface, cut, uv[surface.faces])


@pytest.mark.parametrize("shuffled", [False, True])
def test_the_cheapest_of_each_component_is_kept(shuffled: bool) -> None:
    """The faces of a search are numbered by their position, in any order of those of the file."""
    surface = two_balls()
    if shuffled:
        surface = replace(surface, source=np.random.default_rng(0).permutation(surface.source) + 7)
    first = surface.components[1] == 0
    dear, cheap = halved(surface, 30), halved(surface)
    reached = Reached(surface)
    reached.keep(dear.part(first))
    assert np.isfinite(reached.cost).sum() == 1
    reached.keep(cheap, sound=False)
    found = reached.atlas()
    assert np.array_equal(found.corners[first], dear.corners[first]), "sound before cheap"
    assert np.array_equal(found.corners[~first], cheap.corners[~first])
    reached.keep(cheap)
    reached.keep(dear)
    assert np.array_equal(reached.atlas().corners, cheap.corners)
    assert np.array_equal(reached.atlas().cut, cheap.cut)
    assert reached.atlas().charts()[0] == 4


def test_a_search_that_is_broken_off_answers_with_what_it_has() -> None:
    surface = two_balls()
    first = surface.components[1] == 0
    monitor = Monitor(timeout=1000.0)

    def search(kept: Atlas | None) -> Atlas:
        if kept is not None:
            monitor.keep(kept)
        raise OutOfTimeError("planted")

    whole = halved(surface)
    assert np.array_equal(in_time(surface, lambda: search(whole), monitor).corners, whole.corners)
    assert monitor.late
    part = whole.part(first)
    half = in_time(surface, lambda: search(part), monitor, partly=True)
    assert np.isfinite(half.corners[first]).all()
    assert np.isnan(half.corners[~first]).all()
    for kept, partly in ((part, False), (None, True)):
        with pytest.raises(OutOfTimeError, match="planted"):
            in_time(surface, lambda k=kept: search(k), monitor, partly=partly)
