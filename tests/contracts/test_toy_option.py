"""An option is one field: a dataclass with one more is checked, has its flags, its help and its keywords."""

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


def given(*words: str) -> dict[str, Any]:
    result = CliRunner().invoke(command, words)
    assert result.exit_code == 0, result.output
    return eval(result.output)


def test_what_is_not_given_is_left_out() -> None:
    assert given() == {}


def test_flags_become_keywords() -> None:
    words = ("--bend", "2", "--shade", "dark", "--no-sound", "--grey", "-l", "--pattern", "a.txt")
    assert given(*words) == {
        "bend": 2.0, "shade": "dark", "sound": False, "colour": False, "loud": True,
        "pattern": "a.txt",
    }  # fmt: skip
    assert given("--colour") == {"colour": True}


def test_the_help_reads_the_field() -> None:
    text = CliRunner().invoke(command, ["--help"]).output
    assert "--bend B" in text
    assert "How much to bend.  [default: 2]" in text
    assert "--shade [light|dark]" in text


def test_flags_of_the_wrong_kind_are_refused() -> None:
    assert CliRunner().invoke(command, ["--bend", "much"]).exit_code == 2
    assert CliRunner().invoke(command, ["--shade", "grey"]).exit_code == 2


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
