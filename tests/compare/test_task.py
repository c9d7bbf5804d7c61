"""One method as a task: what goes over to another process, and what it measures there."""

import json

import numpy as np
import pytest

from circparam.compare.task import ENOUGH, FLATTEN, REPEATS, flatten_input, flatten_task
from circparam.core.monitor import Monitor
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from tests.support import shapes
from tests.support.charts import patches_of


def test_the_stages_of_one_run_are_parts_of_it() -> None:
    cut_mesh, _ = patches_of(shapes.bumped_disk(300))
    arrays = {
        name: getattr(cut_mesh, name) for name in ("faces", "rest_triangles", "chart", "edges")
    }
    settings = {"method": "circle", "options": {}, "timeout": None}
    _, info = flatten_task(arrays, settings)
    assert info["runs"] >= 1
    assert 0 < sum(info["stages"].values()) <= info["seconds"]


def test_the_task_has_the_name_that_is_called() -> None:
    module, name = FLATTEN.split(":")
    assert (module, name) == (flatten_task.__module__, flatten_task.__name__)


@pytest.mark.parametrize(
    "options",
    [
        MethodOptions(),
        MethodOptions(boundary="square", spacing="uniform", clamp=True),
        MethodOptions(boundary="polygon", polygon=np.array([[0, 0], [3, 0], [1, 2.0]])),
    ],
)
def test_all_options_reach_the_method(options: MethodOptions) -> None:
    cut_mesh, _ = patches_of(shapes.bumped_disk(60))
    arrays, settings = flatten_input("harmonic", cut_mesh, options, None)
    out, info = flatten_task(arrays, json.loads(json.dumps(settings)))
    same = METHODS["harmonic"].function(cut_mesh, options, Monitor())
    np.testing.assert_array_equal(out["uv"], same.uv)
    assert info["notes"] == same.notes


def test_short_work_is_done_several_times_but_not_for_ever() -> None:
    cut_mesh, _ = patches_of(shapes.bumped_disk(60))
    _, info = flatten_task(*flatten_input("circle", cut_mesh, MethodOptions(), None))
    assert 1 <= info["runs"] <= REPEATS
    assert info["runs"] == REPEATS or info["runs"] * info["seconds"] >= ENOUGH / 2
    assert info["iterations"] == 1
