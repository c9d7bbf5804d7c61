"""Shared options: names out of tables, older flags, and the keywords of the library."""

import json
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from circparam.cli import cli, common
from circparam.core.fields import specs
from circparam.formats.table import FORMATS
from circparam.pipeline.options import Options
from tests.cli.test_unwrap import QUICK, obj
from tests.support import shapes


@pytest.mark.parametrize(
    ("word", "now"),
    [
        ("--border", "--boundary"),
        ("--border=square", "--boundary=square"),
        ("--bff-border=a=b", "--bff-boundary=a=b"),
        ("--borders", "--borders"),
        ("border", "border"),
        ("--boundary", "--boundary"),
        ("a=b", "a=b"),
    ],
)
def test_words_by_the_name_of_today(word: str, now: str) -> None:
    assert common.today(word) == now


@pytest.mark.parametrize(
    ("given", "keywords"),
    [
        ({"padding": None, "clamp": False, "no_scale": False}, {}),
        ({"padding": 0, "uv_set": 0, "effort": 0.0}, {"padding": 0, "uv_set": 0, "effort": 0.0}),
        ({"no_scale": True, "no_normalize": True}, {"scale": False, "normalize": False}),
        ({"repair": False, "cut_materials": False}, {"repair": False, "cut_materials": False}),
        ({"clamp": True, "quiet": True, "as_json": True}, {"clamp": True}),
    ],
)
def test_keywords_are_what_was_given(given: dict[str, Any], keywords: dict[str, Any]) -> None:
    assert common.library_keywords(given) == keywords


def test_nothing_is_not_the_same_as_no_option(tmp_path: Path) -> None:
    """``--padding 0`` is a padding, not the lack of one."""
    mesh = obj(tmp_path / "m.obj", shapes.bumped_disk(60))
    words = ["unwrap", str(mesh), "--cut", "none", *QUICK, "--padding", "0", "--json"]
    got = json.loads(CliRunner().invoke(cli, words).stdout)
    assert got["options"]["padding"] == 0
    assert got["border_texels"] < 4
    words = ["unwrap", str(tmp_path / "m_uv.obj"), "--uv-set", "0", "--overwrite-uv", *QUICK, "-q"]
    assert CliRunner().invoke(cli, words).exit_code == 0


def test_every_option_of_the_library_is_a_flag_of_unwrap() -> None:
    """Or of pack, where charts are there that can be locked."""
    commands = [cli.get_command(click.Context(cli), name) for name in ("unwrap", "pack")]
    flags = {word for command in commands if command for p in command.params for word in p.opts}
    missing = [
        name
        for name, spec in specs(Options).items()
        if (spec.flag.split("/")[0] or "--" + name.replace("_", "-")).split(" ")[0] not in flags
    ]
    assert missing == []


@click.command()
@click.option("--fruit", type=common.Name("fruit", lambda: ["apple", "pear"]))
@click.option("--nut", type=common.Name("nut", lambda: ["hazel", "wal"], listed=True))
def fruit(fruit: str, nut: str) -> None:
    click.echo(fruit)


def test_names_of_a_table() -> None:
    run = CliRunner().invoke
    assert run(fruit, ["--fruit", "pear"]).output == "pear\n"
    assert run(fruit, ["--fruit", "pear:ripe"]).output == "pear:ripe\n"
    wrong = run(fruit, ["--fruit", "appel"])
    assert wrong.exit_code == 2
    assert "unknown fruit 'appel': did you mean apple?" in wrong.output
    text = run(fruit, ["--help"]).output
    assert "--fruit FRUIT" in text
    assert "--nut [hazel|wal]" in text


def test_names_are_completed() -> None:
    param = fruit.params[0]
    items = param.type.shell_complete(click.Context(fruit), param, "p")
    assert [item.value for item in items] == ["pear"]


def test_formats_are_those_of_the_table() -> None:
    text = CliRunner().invoke(cli, ["check", "--help"]).stdout
    assert f"[{'|'.join(FORMATS.names())}]" in text
