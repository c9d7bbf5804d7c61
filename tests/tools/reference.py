"""docs/cli.md, the reference of the command line, made from the help texts.

usage: ``python -m tests.tools.reference``
"""

from pathlib import Path

import click
from click.testing import CliRunner

from circparam.cli import cli, exits

PAGE = Path(__file__).parents[2] / "docs" / "cli.md"


def page() -> str:
    """The whole page."""
    names = cli.list_commands(click.Context(cli))
    intro = "Generated from the help texts by `make docs`; `make test` fails if the page is out of date."
    blocks = {
        f"# Command line\n\n{intro}": _help(),
        "## Exit codes": str(exits.__doc__).split("\n\n", 1)[1].strip(),
        **{f"## circparam {name}": _help(name) for name in names},
    }
    return "\n".join(f"{title}\n\n```\n{text}\n```\n" for title, text in blocks.items())


def _help(*args: str) -> str:
    result = CliRunner().invoke(cli, [*args, "--help"], env={"COLUMNS": "100"})
    lines = [line.rstrip() for line in result.stdout.rstrip().splitlines()]
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
