"""Large surfaces: charts made on a smaller surface first, a level, keep everything that is promised of them."""

import numpy as np
import pytest

from circparam.seams import charts as module
from circparam.seams import finish, grown, stretch
from circparam.seams.options import Search
from tests.support import shapes
from tests.support.atlases import assert_promises, charts_of, surface_of

BOUND = 1.05


@pytest.fixture
def small_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Surfaces above 6000 faces go through a level of 4000."""
    for one in (module, grown, stretch, finish):
        monkeypatch.setattr(one, "LEVEL_FACES", 6_000)
    monkeypatch.setattr(grown, "LEAST_LEVEL", 4_000)


def rough(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A rough torus of 12,800 faces with three small balls of 80 faces beside it."""
    body = shapes.noisy(*shapes.torus(128, 50), amount=0.004, seed=seed)
    ball = shapes.icosphere(1)
    balls = [(ball[0] * 0.05 + [2.0 + k, 0, 0], ball[1]) for k in range(3)]
    return shapes.join(body, *balls)


@pytest.mark.usefixtures("small_levels")
def test_charts_of_a_level_are_good_and_their_seams_as_short_as_without_one(monkeypatch) -> None:
    surface = surface_of(*rough(1))
    by_level = charts_of(surface)
    assert_promises(by_level, BOUND)
    monkeypatch.undo()
    direct = charts_of(surface)
    assert by_level.seam_length <= 1.25 * direct.seam_length
    assert by_level.charts()[0] <= direct.charts()[0] + 2


def test_small_components_that_no_level_shrinks_need_none() -> None:
    """199 open balls of 280 faces: decimation takes components of up to 300 faces over as they are."""
    points, faces = shapes.icosphere(2)
    balls = [(points + np.array([3.0 * k, 0, 0]), faces[40:]) for k in range(199)]
    surface = surface_of(*shapes.join(*balls))
    assert len(surface.faces) > grown.DRAFT_LEVEL_FACES
    assert_promises(charts_of(surface, search=Search(draft=True)), BOUND)
