"""The command line as a whole: help, did-you-mean."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from circparam.cli import COMMANDS, cli


def commands() -> list[str]:
    return cli.list_commands(click.Context(cli))


def test_every_command_of_the_table_exists() -> None:
    assert commands() == list(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_with_an_example(name: str) -> None:
    result = CliRunner().invoke(cli, [name, "--help"])
    assert result.exit_code == 0, result.stderr
    assert "Example" in result.stdout
    assert f"circparam {name}" in result.stdout
    assert max(len(line) for line in result.stdout.splitlines()) <= 100


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_explained(name: str) -> None:
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    assert command.help
    for param in command.params:
        if isinstance(param, click.Option):
            assert param.help, f"{name} {param.opts}"


def test_version() -> None:
    from circparam import __version__

    result = CliRunner().invoke(cli, ["--version"])
    assert result.stdout.split() == ["circparam,", "version", __version__]


@pytest.mark.parametrize(
    ("args", "word"),
    [
        (["unwarp"], "did you mean unwrap?"),
        (["xyzzy"], "choose unwrap, "),
        (["--frobnicate"], "--frobnicate"),
        (["unwrap", "--metod", "circle"], "--method"),
        (["samples", "creatur", "-o", "x.ply"], "did you mean creature"),
    ],
)
def test_what_is_unknown_is_named_with_what_is_near(args: list[str], word: str) -> None:
    result = CliRunner().invoke(cli, args)
    assert result.exit_code == 2
    assert word in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("circparam: error: ")


def test_a_file_for_a_command_names_the_cure(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("")
    result = CliRunner().invoke(cli, [str(mesh)])
    assert result.exit_code == 2
    assert f"circparam unwrap {mesh}" in result.stderr
