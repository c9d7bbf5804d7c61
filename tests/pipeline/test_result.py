"""The judgement on a layout: ok, repaired or degraded, with reasons."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.errors import OutOfTimeError
from circparam.formats.memory import from_arrays
from circparam.pipeline.job import prepare
from circparam.pipeline.options import Options
from circparam.pipeline.result import promise, status_of, verify_layout
from tests.support import shapes


def judged(scale: object, repairs: list[str], expired: bool = False, **options: object):
    """The status of a flat square whose uv are its points, stretched."""
    document = from_arrays(*shapes.grid(4, 4))
    asked = Options(**options)
    job = prepare(document, None, asked, Monitor())
    cut_mesh = job.surface.cut_mesh(np.zeros(len(job.surface.edges), bool))
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()] = job.surface.points[job.surface.faces.ravel(), :2]
    uv = 0.1 + 0.8 * uv * scale
    return status_of(
        verify_layout(job.surface, job.completed(cut_mesh, uv), asked), asked, repairs, expired
    )


def test_right_repaired_and_wrong() -> None:
    assert judged(1.0, []).status == "ok"
    mended = judged(1.0, ["one thing"])
    assert (mended.status, mended.reasons, mended.warnings) == ("repaired", ["one thing"], [])
    stretched = judged([1.0, 0.2], [], max_distortion=1.05)
    assert stretched.status == "degraded"
    assert stretched.reasons == stretched.warnings
    assert "above the bound 1.05" in stretched.reasons[0]


def test_out_of_time_with_and_without_a_valid_layout() -> None:
    late = judged(1.0, [], expired=True)
    assert late.status == "ok"
    assert any("out of time" in line for line in late.warnings)
    with pytest.raises(OutOfTimeError, match="no valid result"):
        judged([1.0, 0.0], [], expired=True)


def test_the_promise_is_that_of_the_options() -> None:
    assert promise(Options()).padding == promise(Options(padding=4)).padding
    assert promise(Options(padding=9)).padding == 9
    assert promise(Options(normalize=False)).padding is None
