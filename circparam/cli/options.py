"""Shared options as values: one spelling and one help text for every command that has them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import click

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


# flags that had another name before; they keep working and stand in no help text
OLDER_FLAGS = {"--border": "--boundary", "--bff-border": "--bff-boundary"}


class Command(click.Command):
    """A command that also takes the older names of its flags."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put today's name in the place of an older one, then read on as click does."""
        return super().parse_args(ctx, [today(word) for word in args])


def today(word: str) -> str:
    """A word of the command line, an older flag (also ``--flag=value``) by the name it has today."""
    flag, sign, value = word.partition("=")
    return OLDER_FLAGS.get(flag, flag) + sign + value


class Name(click.ParamType[str]):
    """A name out of a table of the library, loaded when it is needed: did-you-mean, and shell completion."""

    name = "name"

    def __init__(self, kind: str, names: Callable[[], list[str]]) -> None:
        self.kind, self.names = kind, names

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value, where the table has it."""
        from circparam.core.registry import unknown_name

        names = self.names()
        if value not in names:
            self.fail(unknown_name(self.kind, str(value), names), param, ctx)
        return value

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """The word for the help text."""
        return self.kind.upper()

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[click.shell_completion.CompletionItem]:
        """Names that begin so."""
        item = click.shell_completion.CompletionItem
        return [item(name) for name in self.names() if name.startswith(incomplete)]


def method_names() -> list[str]:
    """Every method of the table."""
    from circparam.methods import METHODS

    return METHODS.names()


def start_names() -> list[str]:
    """Convex maps with positive weights: what isometric may begin with."""
    from circparam.methods import METHODS

    return METHODS.tagged("positive")


METHOD = Name("method", method_names)
START = Name("start", start_names)
MESH = click.Path(dir_okay=True, allow_dash=True)  # a directory is the library's error (exit 3)
FILE = click.Path()

method = click.option(
    "--method",
    "-m",
    type=METHOD,
    help="How charts are flattened: see circparam methods.  [default: isometric]",
)

json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON on stdout.")

overwrite = click.option(
    "--overwrite", is_flag=True, help="Replace an output file that exists already."
)

quiet = click.option("--quiet", "-q", is_flag=True, help="No progress, no table, no warnings.")

verbose = click.option("--verbose", "-v", count=True, help="Show more: -v stages, -vv notes.")

output = click.option("--output", "-o", type=FILE, metavar="FILE", help="Where to write.")

out_dir = click.option(
    "--out-dir",
    type=FILE,
    metavar="DIR",
    help="Folder for the outputs, with the names of the inputs.",
)

format_option = click.option(
    "--format",
    "format",
    type=click.Choice(["obj", "ply", "glb", "gltf", "stl", "off"], case_sensitive=False),
    help="Format of what comes through '-' (stdin, stdout).",
)

uv_set = click.option(
    "--uv-set", type=int, metavar="N", help="Which uv set of the file, from 0 on."
)

resolution = click.option(
    "--resolution", type=int, metavar="TEXELS", help="Side of a page in texels.  [default: 2048]"
)

padding = click.option(
    "--padding",
    type=int,
    metavar="TEXELS",
    help="Empty texels between charts and at the border.  [default: 4]",
)

packing = [
    resolution,
    padding,
    click.option("--pages", type=int, metavar="N", help="Number of pages (UDIM tiles) to fill."),
    click.option(
        "--texel-density",
        type=float,
        metavar="D",
        help="Texels per unit of the mesh, instead of filling.",
    ),
    click.option(
        "--rotate",
        type=click.Choice(["free", "90", "none"]),
        help="How charts may be turned.  [default: free]",
    ),
    click.option(
        "--effort",
        type=float,
        metavar="X",
        help="Search longer or shorter for a good packing.  [default: 1]",
    ),
    click.option(
        "--no-scale", is_flag=True, help="Keep the sizes of the charts: 1 unit is 1 page."
    ),
]

gates = click.option(
    "--fail-if",
    metavar="GATES",
    help="Exit 6 where a condition holds, for example 'flips>0,overlap>0,distortion>1.05'.",
)


def apply(*options: Decorator | Sequence[Decorator]) -> Decorator:
    """Several options as one decorator, in the order in which the help shows them."""
    flat = [o for item in options for o in (item if isinstance(item, Sequence) else [item])]

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(flat):
            function = option(function)
        return function

    return decorate
