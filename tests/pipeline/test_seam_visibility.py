"""What is seen of the seams: the same whoever looks, and left out where no time is left."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

import circparam
from circparam.core import workers
from circparam.core.monitor import Monitor
from circparam.geometry.visibility import visible_share
from circparam.mesh.mesh import UVMap
from circparam.pipeline import seam_visibility, unwrap
from circparam.pipeline.result import Result
from tests.support import shapes


@pytest.fixture(autouse=True)
def none_left() -> Iterator[None]:
    yield
    workers.stop()


@pytest.fixture(scope="module")
def torus() -> Result:
    return circparam.unwrap(shapes.torus(16, 8), jobs=1, effort="draft")


def told(result: Result, monitor: Monitor) -> Result:
    """The result as the end of an unwrap with that monitor leaves it."""
    uvmap = UVMap(result.uv, result.uv_faces)
    found = seam_visibility.SeamVisibility(result.surface, uvmap, monitor).completed(
        result.verification
    )
    return replace(result, verification=replace(found))


def test_a_process_that_looks_finds_what_is_found_here(torus: Result) -> None:
    workers.start(2, seam_visibility.__name__)
    pool = workers.current()
    pool.ready.result()
    beside = told(torus, Monitor(jobs=2)).verification
    assert isinstance(getattr(beside.seen, "__self__", None), workers.DeferredTask)
    expected = visible_share(torus.surface, torus.verification.cut)
    assert 0 < expected < 1
    assert beside.seam_visible == expected
    assert told(torus, Monitor()).verification.seam_visible == expected


def test_an_unwrap_out_of_time_does_not_look() -> None:
    def strike(stage: str, *_: object) -> None:
        if stage == "check":
            monitor.deadline = 0.0

    monitor = Monitor(listener=strike, timeout=1000.0)
    options = circparam.Options(effort="draft")
    document = unwrap.open_source(shapes.torus(16, 8), options)
    result = unwrap.unwrap_document(document, None, options, monitor)
    assert result.verification.valid
    assert result.measures["seam_visible"] is None
