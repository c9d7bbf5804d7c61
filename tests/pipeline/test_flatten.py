"""The first layout: pins by vertex of the mesh, and what the cascade is told."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.errors import OptionError
from circparam.formats.memory import from_arrays
from circparam.pipeline.cascade import FAULTY
from circparam.pipeline.flatten import first_layout, rules
from circparam.pipeline.job import Job, prepare
from circparam.pipeline.options import Options
from circparam.seams.options import Seams
from tests.support import shapes


def job_of(pins: list[list[float]]) -> Job:
    options = Options(method="lscm", cut="none", pins=np.array(pins, float))
    return prepare(from_arrays(*shapes.grid(5, 5)), None, options, Monitor())


PINS = {
    "twice": ([[0, 0, 0], [0, 1, 1]], "twice"),
    "outside": ([[0, 0, 0], [999, 1, 1]], "999"),
    "one too far": ([[0, 0, 0], [25, 1, 1]], "25"),
    "negative": ([[-1, 0, 0], [2, 1, 1]], "-1"),
}


@pytest.mark.parametrize("name", PINS)
def test_bad_pins_are_named(name: str) -> None:
    pins, word = PINS[name]
    job = job_of(pins)
    with pytest.raises(OptionError, match=word):
        first_layout(job, Seams(np.zeros(len(job.surface.edges), bool)), Monitor())


def test_pins_hold_their_vertices() -> None:
    job = job_of([[0, 3, 1], [24, 5, 4]])
    cascade = first_layout(job, Seams(np.zeros(len(job.surface.edges), bool)), Monitor())
    at = {
        int(v): uv
        for v, uv in zip(
            job.surface.faces.ravel(), cascade.atlas.corners.reshape(-1, 2), strict=True
        )
    }
    np.testing.assert_allclose([at[0], at[24]], [[3, 1], [5, 4]], atol=1e-9)


def test_a_pin_on_a_seam_is_refused() -> None:
    job = job_of([[12, 0, 0], [3, 1, 1]])
    s = job.surface
    h = s.edges[:, 0]
    ends = s.faces.ravel()[h], s.faces[h // 3, (h % 3 + 1) % 3]
    seams = Seams(np.isin(ends[0], [12]) | np.isin(ends[1], [12]))
    with pytest.raises(OptionError, match="12, which lies on a seam"):
        first_layout(job, seams, Monitor())


def test_the_bound_holds_only_where_splitting_can_reach_it() -> None:
    assert rules(Options(max_distortion=1.02)).bound == 1.02
    for free in ({"max_charts": 2}, {"no_seams": [[0, 1]]}, {"blend": 0.5}, {"method": "lscm"}):
        assert rules(Options(**free)).bound == FAULTY
    assert rules(Options()).may_split
    assert not rules(Options(cut="disk")).may_split


def test_a_convex_map_of_a_disk_is_not_replaced_by_another() -> None:
    assert not rules(Options(method="circle", cut="disk")).remap
    assert rules(Options(method="circle")).remap
    assert rules(Options(method="lscm", cut="disk")).remap
