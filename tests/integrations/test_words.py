"""Errors name keywords where a Python caller reads them, flags where a shell user does."""

import pytest

import circparam
from circparam.errors import CircparamError
from circparam.integrations.words import in_python
from circparam.pipeline.unwrap import unwrap as of_the_pipeline
from tests.support import shapes

SAID = {
    "--max-distortion 0.5: it is an energy": "max_distortion=0.5: it is an energy",
    "it shapes --cut charts, not --cut disk": "it shapes cut='charts', not cut='disk'",
    "replace it with --overwrite": "replace it with overwrite=True",
    "give a longer --timeout": "give a longer timeout",
    "--no-scale keeps the sizes": "scale=False keeps the sizes",
    "leave out --no-repair": "leave out repair=False",
    "--cut-materials has no effect": "cut_materials=True has no effect",
    "--pin names vertex 7, which": "pins names vertex 7, which",
    "raise --resolution or --pages": "raise resolution or pages",
    "--seams lie inside": "seams lie inside",
    "needs --boundary polygon": "needs boundary='polygon'",
    "--fail-if 'a>b' is no condition": "--fail-if 'a>b' is no condition",
    "a--cut b and ---": "a--cut b and ---",
    "unknown --rotate 'x': choose one of free": "unknown rotate='x': choose one of free",
    "only --method isometric can blend": "only method='isometric' can blend",
}


@pytest.mark.parametrize("message", SAID)
def test_flags_become_keywords(message: str) -> None:
    assert in_python(message) == SAID[message]


def test_the_command_line_keeps_its_flags_and_python_its_keywords() -> None:
    mesh = shapes.cube(1)
    with pytest.raises(CircparamError, match="--padding 5000") as shell:
        of_the_pipeline(mesh, padding=5000)
    with pytest.raises(CircparamError, match="padding=5000") as python:
        circparam.unwrap(mesh, padding=5000)
    assert type(shell.value) is type(python.value)
    assert "--" not in str(python.value)
