"""What is bad about a file costs little more than the mesh: work is counted, not seconds."""

import sys
from types import FrameType

import circparam
from circparam.core.linalg import Factor
from circparam.seams.cost import COST
from tests.support.bad_twins import TWINS, Faces, clean
from tests.support.parts import bracket

TIMES = 3.0  # what the issue allows a bad twin


def work_of(mesh: Faces) -> tuple[float, float, float]:
    """(calls of Python functions, unknowns of all systems that were factored, cost of seams) of an unwrap."""
    calls, unknowns = 0, 0
    factor = Factor.__init__.__code__

    def called(frame: FrameType, event: str, argument: object) -> None:
        nonlocal calls, unknowns
        if event == "call":
            calls += 1
            if frame.f_code is factor:
                unknowns += frame.f_locals["matrix"].shape[0]

    before = sys.getprofile()
    sys.setprofile(called)
    try:
        result = circparam.unwrap(mesh, jobs=1, effort="draft")
    finally:
        sys.setprofile(before)
    assert result.verification.flips == 0
    assert len(result.charts) == len(mesh[1])
    seams = result.measures["seam_length"] + COST.chart * result.measures["charts"]
    return calls, unknowns, seams


def test_bad_twins_are_no_more_work_and_seam_than_three_clean_parts() -> None:
    part = bracket()
    circparam.unwrap(
        clean(part), jobs=1, effort="draft"
    )  # what is imported on the way is no work of the part
    one = work_of(clean(part))
    slow = {}
    for name, make in TWINS.items():
        more = [a / b for a, b in zip(work_of(make(part)), one, strict=True)]
        if max(more) > TIMES:
            slow[name] = more
    assert not slow
