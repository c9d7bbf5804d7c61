"""The judgement on a layout: ok, repaired or degraded, with reasons."""

from dataclasses import replace

import pytest

import circparam
from circparam.errors import OutOfTimeError
from circparam.mesh.mesh import UVMap
from circparam.pipeline.options import Options
from circparam.pipeline.result import Result, judged, promise, verify_layout
from tests.support import shapes


def judgement(
    scale: object, repairs: list[str], expired: bool = False, **options: object
) -> Result:
    """That on a flat square whose uv are its points, stretched."""
    points, faces = shapes.grid(4, 4)
    made = circparam.unwrap((points, faces), effort=0.01, jobs=1)
    uvmap, asked = UVMap(0.1 + 0.8 * points[:, :2] * scale, faces), Options(**options)
    found = verify_layout(made.surface, uvmap, asked)
    return judged(replace(made, options=asked, repairs=repairs, verification=found), expired)


def test_right_repaired_and_wrong() -> None:
    assert judgement(1.0, []).status == "ok"
    mended = judgement(1.0, ["one thing"])
    assert (mended.status, mended.reasons, mended.warnings) == ("repaired", ["one thing"], [])
    stretched = judgement([1.0, 0.2], [], max_distortion=1.05)
    assert stretched.status == "degraded"
    assert stretched.reasons == stretched.warnings
    assert "above the bound 1.05" in stretched.reasons[0]


def test_out_of_time_with_and_without_a_valid_layout() -> None:
    late = judgement(1.0, [], expired=True)
    assert late.status == "ok"
    assert any("out of time" in line for line in late.warnings)
    with pytest.raises(OutOfTimeError, match="no valid result"):
        judgement([1.0, 0.0], [], expired=True)


def test_the_promise_is_that_of_the_options() -> None:
    assert promise(Options()).padding == promise(Options(padding=4)).padding
    assert promise(Options(padding=9)).padding == 9
    assert promise(Options(normalize=False)).padding is None
