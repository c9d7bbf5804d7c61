"""Errors name keywords where a Python caller reads them, flags where a shell user does."""

import re
from pathlib import Path

import pytest

import circparam
from circparam.errors import OptionError
from circparam.pipeline.words import in_python
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


def test_every_public_function_speaks_python(tmp_path: Path) -> None:
    """They named flags of their commands: --from, --methods, --overwrite, --padding."""
    mesh, there = tmp_path / "m.obj", tmp_path / "there.png"
    circparam.unwrap(shapes.cube(1), mesh, effort="draft", jobs=1)
    there.touch()
    bake, compare = circparam.bake, circparam.compare
    for call, said in (
        (lambda: bake(mesh, "textur"), "unknown kind='textur'"),
        (lambda: bake(mesh, "height"), "kind='height' needs the mesh whose shape is baked: source"),
        (lambda: bake(mesh, "normals", there), "replace it with overwrite=True"),
        (lambda: bake(mesh, "normals", source=mesh, size=1.5), "size=1.5: give a whole number"),
        (lambda: bake(mesh, "normals", source=mesh, across="x"), "across.by='x': give nearest"),
        (lambda: bake(mesh, "texture", across="nearest"), "name it with source"),
        (lambda: compare(mesh, ""), "methods names no method"),
        (lambda: compare(mesh, "lscm", padding=10**7), "padding=10000000"),
        (lambda: compare(mesh, "lscm", paddin=1), "did you mean padding"),
        (lambda: circparam.transfer(mesh, [mesh], max_drift=-1), "max_drift=-1"),
        (lambda: circparam.unwrap(mesh, padding=5000), "padding=5000"),
        (lambda: circparam.view(mesh, there), "overwrite=True"),
        (lambda: circparam.rebake(mesh, tmp_path / "n.obj", padding=5000), "padding=5000"),
    ):
        with pytest.raises(OptionError, match=re.escape(said)) as error:
            call()
        assert "--" not in str(error.value)
