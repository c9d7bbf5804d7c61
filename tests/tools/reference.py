"""docs/cli.md, the reference of the command line, made from the help texts.

usage: ``python -m tests.tools.reference [--check]``
"""

import sys
from pathlib import Path

import click
from click.testing import CliRunner

from circparam.cli import cli, exits

PAGE = Path(__file__).parents[2] / "docs" / "cli.md"


def page() -> str:
    """The whole page."""
    names = cli.list_commands(click.Context(cli))
    parts = [
        "# Command line",
        "",
        "Generated from the help texts by `make docs`; `make test` fails if the page is out of date.",
        "",
        "```",
        _help(),
        "```",
        "",
        "## Exit codes",
        "",
        "```",
        str(exits.__doc__).split("\n\n", 1)[1].strip(),
        "```",
    ]
    for name in names:
        parts += ["", f"## circparam {name}", "", "```", _help(name), "```"]
    return "\n".join(parts) + "\n"


def _help(*args: str) -> str:
    result = CliRunner().invoke(cli, [*args, "--help"], env={"COLUMNS": "100"})
    lines = [line.rstrip() for line in result.stdout.rstrip().splitlines()]
    return "\n".join(lines)


def main() -> int:
    """Write the page, or with ``--check`` tell whether it is current."""
    text = page()
    if "--check" in sys.argv[1:]:
        current = PAGE.exists() and PAGE.read_text("utf-8") == text
        if not current:
            print("docs/cli.md is not what the help texts say: run make docs", file=sys.stderr)
        return 0 if current else 1
    PAGE.write_text(text, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
