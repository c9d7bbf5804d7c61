"""The command line as a whole: help, sections, names out of tables, and the keywords of the library."""

import re
from pathlib import Path

import click
import pytest

from circparam import __version__
from circparam.cli import COMMANDS, cli, common
from circparam.core.fields import flag, specs
from circparam.pipeline.options import Options
from tests.support import shapes
from tests.support.command_line import QUICK, obj, report, run


def command_of(name: str) -> click.Command:
    return cli.get_command(click.Context(cli), name)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_has_help_with_an_example(name: str) -> None:
    text = run(name, "--help").stdout
    assert f"circparam {name}" in text.split("Example")[1]
    command = command_of(name)
    assert command.help
    for param in command.params:
        if isinstance(param, click.Option):
            assert param.help, f"{name} {param.opts}"


def test_help_and_version_without_a_command() -> None:
    assert cli.list_commands(click.Context(cli)) == list(COMMANDS)
    alone, asked = run(), run("--help")
    assert (alone.exit_code, alone.stdout, alone.stderr) == (0, asked.stdout, "")
    assert run("--version").stdout.split() == ["circparam,", "version", __version__]


def sections(name: str) -> dict[str, list[str]]:
    """Heading → the flags below it, of a help text."""
    out: dict[str, list[str]] = {}
    heading = ""
    for line in run(name, "--help").stdout.splitlines():
        if line and not line.startswith(" "):
            heading = line.rstrip(":")
        found = re.match(r"  (?:-\w, )?(--[\w-]+)", line)
        if found:
            out.setdefault(heading, []).append(found.group(1))
    return out


def test_the_help_of_unwrap_has_sections() -> None:
    """Every flag stands in one, those of the library by their stage; figures are explained once."""
    found = sections("unwrap")
    assert list(found) == list(common.SECTIONS)
    given = [p.opts for p in command_of("unwrap").params if isinstance(p, click.Option)]
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
    text = run("unwrap", "--help").stdout
    for word in ("distortion  ", "seam length  ", "packed  "):
        assert text.count(f"    {word}") == 1


def test_every_option_of_the_library_is_a_flag() -> None:
    """Of unwrap, or of pack, where charts are there that can be locked; batch has those of unwrap."""
    unwrap, pack, batch = (
        {word for p in command_of(name).params for word in p.opts}
        for name in ("unwrap", "pack", "batch")
    )
    assert {flag(*item).split(" ")[0] for item in specs(Options).items()} <= unwrap | pack
    streams = {"-o", "--output", "--out-dir", "--format", "-j", "--jobs", "--debug", "meshes"}
    assert unwrap - streams - {"--one-atlas"} <= batch


def test_nothing_is_not_the_same_as_no_option(tmp_path: Path) -> None:
    """``--padding 0`` is a padding, not the lack of one."""
    mesh = obj(tmp_path / "m.obj", shapes.bumped_disk(60))
    got = report("unwrap", mesh, "--cut", "none", *QUICK, "--padding", "0")
    assert got["options"]["padding"] == 0
    assert got["border_texels"] < 4
    words = ("--uv-set", "0", "--overwrite-uv", *QUICK, "-q")
    assert run("unwrap", tmp_path / "m_uv.obj", *words).exit_code == 0
