"""An option is one field: a dataclass with one more is checked, has its flags, its help and its keywords."""

import ast
from dataclasses import dataclass
from typing import Any

import click
import pytest
from click.testing import CliRunner

from circparam.cli import common
from circparam.core.fields import Range, option
from circparam.errors import OptionError
from circparam.pipeline.options import Options


def _with_a_disk(o: Any, name: str) -> str | None:
    return None if o.cut == "disk" else "it bends disks only"


@dataclass(frozen=True, eq=False)
class ToyOptions(Options):
    bend: float | None = option(
        "toys", "How much to bend.", metavar="B", shown="2", applies=_with_a_disk,
        bounds=Range(1, 3, "a bend from 1 to 3"),
    )  # fmt: skip
    shade: str | None = option("toys", "Light or dark.", choices=("light", "dark"))
    sound: bool | None = option("toys", "Be silent.", flag="--no-sound")
    colour: bool | None = option("toys", "In colour or not.", flag="--colour/--grey")
    loud: bool | None = option("toys", "Be loud.", short="-l")
    pattern: Any = option("toys", "A file.", metavar="FILE")


@click.command()
@common.apply(common.library_options("toys", ToyOptions))
def command(**given: Any) -> None:
    click.echo(repr(common.library_keywords(given, ToyOptions)))


def answered(*words: str) -> str:
    return CliRunner().invoke(command, words).output


def test_flags_become_keywords_and_the_help_reads_the_field() -> None:
    """What is not given is left out, and what is of the wrong kind is refused."""
    words = ("--bend", "2", "--shade", "dark", "--no-sound", "--grey", "-l", "--pattern", "a.txt")
    given = {"bend": 2.0, "shade": "dark", "sound": False, "colour": False, "loud": True}
    assert ast.literal_eval(answered(*words)) == {**given, "pattern": "a.txt"}
    assert ast.literal_eval(answered("--colour")) == {"colour": True}
    assert ast.literal_eval(answered()) == {}
    for help_text in ("--bend B", "How much to bend.  [default: 2]", "--shade [light|dark]"):
        assert help_text in answered("--help")
    for wrong in (["--bend", "much"], ["--shade", "grey"]):
        assert CliRunner().invoke(command, wrong).exit_code == 2


@pytest.mark.parametrize(
    ("keywords", "line"),
    [
        ({"cut": "disk", "bend": 0.99}, "--bend 0.99: give a bend from 1 to 3"),
        ({"cut": "disk", "bend": 3.01}, "--bend 3.01: give a bend from 1 to 3"),
        ({"bend": 2}, "--bend has no effect here: it bends disks only; leave it out"),
        ({"shade": "grey"}, "unknown --shade 'grey': choose one of light, dark"),
        ({"padding": -1}, "--padding -1: give 0 to 4096 texels"),
    ],
)
def test_it_is_checked_when_it_is_made(keywords: dict[str, Any], line: str) -> None:
    with pytest.raises(OptionError) as error:
        ToyOptions(**keywords)
    assert str(error.value) == line
