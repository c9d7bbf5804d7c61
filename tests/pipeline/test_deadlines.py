"""A deadline: wherever time runs out the result is valid, or the error comes at once."""

import numpy as np
import pytest

import circparam
from circparam.core.monitor import Monitor
from circparam.errors import OutOfTimeError
from circparam.pipeline.configure import open_source
from circparam.pipeline.flatten import find_seams
from circparam.pipeline.job import prepare
from circparam.pipeline.options import Options
from circparam.pipeline.unwrap import unwrap_document
from tests.support import shapes
from tests.support.clock import Clock

QUICK = {"effort": 0.01}


STAGES = ("charts", "carry", "relax", "enforce", "stretch", "flatten", "check", "pack", "verify")


@pytest.mark.parametrize("last", STAGES)
def test_wherever_time_runs_out_the_result_is_valid(last: str) -> None:
    """The clock strikes when a stage begins; seams of a surface this large are found on a proxy."""

    def strike(stage: str, *_: object) -> None:
        if stage == last:
            monitor.deadline = 0.0

    monitor, options = Monitor(listener=strike, timeout=1000.0), Options(jobs=1, **QUICK)
    p, f = shapes.icosphere(3)
    document = open_source((p * (1 + 0.5 * np.sin(4 * p[:, :1])), f), options)
    result = unwrap_document(document, None, options, monitor)
    assert result.verification.valid
    assert any("out of time" in w for w in result.warnings) == (monitor.deadline == 0.0)
    assert (result.measures["seam_visible"] is None) == (monitor.deadline == 0.0)


def test_where_not_even_that_can_be_done_in_time_it_is_told_at_once(clock: Clock) -> None:
    monitor = Monitor(timeout=10.0)
    clock.now += 9.0
    monitor.check(1.0)
    monitor.check(2.0)
    with pytest.raises(OutOfTimeError, match="--timeout"):
        monitor.check(5.0)
    monitor.seconds["repair"] = 100.0  # a mesh that it takes very long to go through
    options = circparam.Options(jobs=1, effort=0.01)
    document = open_source(shapes.cube(2), options)
    with pytest.raises(OutOfTimeError):
        unwrap_document(document, None, options, monitor)


@pytest.mark.parametrize(("pace", "begun"), [(0.01, True), (1.0, False)])
def test_no_charts_are_begun_that_the_time_is_too_short_for(pace, begun, clock):
    """With time up a moment is granted, and used where the mesh is gone through in less."""
    monitor = Monitor(timeout=10.0)
    job = prepare(open_source(shapes.cube(4), Options()), None, Options(jobs=1), monitor)
    monitor.seconds["repair"] = pace
    with monitor.holding(100.0):
        assert monitor.expired
        seams = find_seams(job, monitor)
    assert np.isfinite(seams.uv).all() == begun
    assert ("charts" in monitor.seconds) == begun
    assert any("out of time" in note for note in seams.notes) != begun
    assert monitor.hurried
