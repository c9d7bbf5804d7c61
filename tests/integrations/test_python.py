"""The functions of ``import circparam``: every option in the signature, degrees as in the command line."""

import dataclasses
import inspect
import pickle

import pytest

import circparam
from tests.support import shapes
from tests.tools import keywords


def test_typed_keywords_are_those_of_the_options() -> None:
    """Made by ``make docs``; here is noticed where it was not run."""
    assert keywords.PAGE.read_text("utf-8") == keywords.page()


@pytest.mark.parametrize("name", ["unwrap", "repack", "parametrize"])
def test_signatures_list_every_option(name: str) -> None:
    parameters = inspect.signature(getattr(circparam, name)).parameters
    assert {f.name for f in dataclasses.fields(circparam.Options)} <= set(parameters)
    assert all(p.kind is not p.VAR_KEYWORD for p in parameters.values())


@pytest.mark.parametrize("name", [*circparam.__all__, "bake", "compare"])
def test_a_pool_of_processes_takes_every_public_name(name: str) -> None:
    """``pool.map(circparam.unwrap, files)``: what is public is found again under its name."""
    value = getattr(circparam, name)
    assert pickle.loads(pickle.dumps(value)) == value


def test_sharp_is_degrees() -> None:
    """Edges of a cube bend by a right angle: 89 cuts them all, 91 none."""
    mesh = shapes.cube(2)
    assert circparam.unwrap(mesh, sharp=89, effort=0.01).measures["charts"] == 6
    assert circparam.unwrap(mesh, sharp=91, effort=0.01, pack_splits=0).measures["charts"] == 1


def test_unknown_names_have_a_cure() -> None:
    with pytest.raises(circparam.OptionError, match="did you mean max_distortion"):
        circparam.unwrap(shapes.cube(1), max_distorsion=2)
