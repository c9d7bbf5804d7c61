"""A command is one module and one row: added from here it is in the help, runs, and fails as others do."""

import sys
from types import ModuleType
from typing import Any

import click
import pytest

from circparam.cli import COMMANDS, common
from circparam.errors import TopologyError
from tests.support.command_line import run
from tests.tools import reference


@click.command(epilog="Example: circparam toy --times 2")
@common.library_option("padding")
@click.option("--times", type=int, default=1, help="How often.")
@common.quiet
def command(times: int, **given: Any) -> int:
    """Say a word, or fail on purpose."""
    if times < 0:
        raise TopologyError("a word can't be\nunsaid")
    if times > 9:
        raise RuntimeError("too often")
    click.echo(" ".join(["toy"] * times))
    return 6 if given["padding"] else 0


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("circparam.cli.toy")
    module.command = command
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(COMMANDS, "toy", "Say a word.")


def test_it_stands_in_the_help_in_the_reference_and_among_suggestions() -> None:
    (line,) = (x for x in run("--help").stdout.splitlines() if x.strip().startswith("toy"))
    assert line.split() == ["toy", "Say", "a", "word."]
    page = reference.page()
    assert "## circparam toy" in page
    assert "How often." in page
    text = run("toy", "--help").stdout
    assert "--debug" in text
    assert "Empty texels between charts" in text
    assert "did you mean toy" in run("tyo").stderr


def test_what_it_returns_and_raises_are_lines_and_codes() -> None:
    assert run("toy", "--times", "2").stdout == "toy toy\n"
    assert run("toy", "--padding", "3").exit_code == 6
    result = run("toy", "--times", "-1")
    assert (result.exit_code, result.stderr) == (4, "circparam: error: a word can't be unsaid\n")
    result = run("toy", "--times", "10")
    assert (result.exit_code, result.stderr.count("\n")) == (1, 1)
    assert isinstance(run("toy", "--times", "10", "--debug").exception, RuntimeError)
    assert run("toy", "--tims", "1").exit_code == 2
