"""The command line as a whole: help, did-you-mean."""

import re
from dataclasses import dataclass
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from circparam.cli import COMMANDS, cli, common
from circparam.core.fields import flag, option, specs
from circparam.pipeline.options import Options


def commands() -> list[str]:
    return cli.list_commands(click.Context(cli))


def test_every_command_of_the_table_exists() -> None:
    assert commands() == list(COMMANDS)


def test_no_arguments_print_the_help() -> None:
    alone, asked = (CliRunner().invoke(cli, args) for args in ([], ["--help"]))
    assert alone.exit_code == 0
    assert alone.stdout == asked.stdout
    assert not alone.stderr


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


def sections(name: str) -> dict[str, list[str]]:
    """Heading → the flags below it, of a help text."""
    out: dict[str, list[str]] = {}
    heading = ""
    for line in CliRunner().invoke(cli, [name, "--help"]).stdout.splitlines():
        if line and not line.startswith(" "):
            heading = line.rstrip(":")
        found = re.match(r"  (?:-\w, )?(--[\w-]+)", line)
        if found:
            out.setdefault(heading, []).append(found.group(1))
    return out


def test_the_help_of_unwrap_has_sections() -> None:
    """Every flag stands in one, those of the library by their stage."""
    found = sections("unwrap")
    assert list(found) == list(common.SECTIONS)
    command = cli.get_command(click.Context(cli), "unwrap")
    given = [p.opts for p in command.params if isinstance(p, click.Option)]
    flags = [opts[0] if opts[0][:2] == "--" else opts[-1] for opts in given]
    assert sorted(f for names in found.values() for f in names) == sorted([*flags, "--help"])
    spec_of = {flag(n, s): s for n, s in specs(Options).items()}
    for heading, names in found.items():
        for name in names:
            if name in spec_of:
                assert spec_of[name].stage in common.SECTIONS[heading]
    for heading, name in (("Seams", "--export-seams"), ("Checks", "--fail-if"), ("Information", "--json"),
                          ("Input and output", "--out-dir")):  # fmt: skip
        assert name in found[heading]


def test_a_new_option_falls_into_a_section_by_its_stage() -> None:
    @dataclass(frozen=True, eq=False)
    class More(Options):
        toy: bool | None = option("packing", "A toy.")

    @click.command(cls=common.SectionedCommand)
    @common.apply(common.library_options("packing", More))
    def command(**_: object) -> None:
        """Nothing."""

    lines = (
        CliRunner().invoke(command, ["--help"]).stdout.split("Packing:")[1].split("Information:")[0]
    )
    assert "--toy" in lines


def test_the_figures_are_explained_once_by_the_words_of_the_table() -> None:
    text = CliRunner().invoke(cli, ["unwrap", "--help"]).stdout
    for word in ("distortion  ", "seam length  ", "packed  "):
        assert text.count(f"    {word}") == 1
