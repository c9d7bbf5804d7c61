"""Shared options as values: one spelling and one help text for every command that has them.

The metadata of the fields of ``Options`` give the options of the library; options of the command line alone
stand here.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import click
from click.shell_completion import CompletionItem

from circparam.cli import exits, progress
from circparam.core.fields import specs, types_of
from circparam.core.imports import OnDemand
from circparam.core.registry import unknown_name
from circparam.errors import GateError
from circparam.pipeline.options import ALIASES, Options

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
# they keep working and stand in no help text
OLDER_FLAGS = {
    f"--{old}".replace("_", "-"): f"--{new}".replace("_", "-") for old, new in ALIASES.items()
}
tables: Any = OnDemand("circparam.cli.tables")  # with rich, which takes a tenth of a second
formats: Any = OnDemand("circparam.formats.table")


# further files of an unwrap: parameter → flag without its dashes
FURTHER = {"export_seams": "export-seams", "index_map": "map", "preview": "preview"}
# the sections of a long help text, in their order, and the stages of the library's options in each
SECTIONS = {
    "Input and output": ("files", "writing"),
    "Method": ("method", "flattening"),
    "Seams": ("seams",),
    "Packing": ("packing", "locking"),
    "Textures": ("look",),
    "Checks": ("repair", "bounds"),
    "Information": (),
}
INPUT, METHOD, SEAMS, PACKING, TEXTURES, CHECKS, INFORMATION = SECTIONS


class Option(click.Option):
    """A flag that knows in which section of a long help text it stands."""

    def __init__(self, *words: Any, section: str = INFORMATION, **known: Any) -> None:
        super().__init__(*words, **known)
        self.section = section


def value(flag: str, text: str, *names: str, section: str = INFORMATION, **known: Any) -> Decorator:
    """A flag with a value and its section of a long help text, which names the default if there is one."""
    shown = "default" in known and "[default" not in text
    known = {"show_default": shown, "section": section} | known
    return click.option(flag, *names, cls=Option, help=text, **known)


def switch(flag: str, text: str, *names: str, section: str = INFORMATION) -> Decorator:
    """A flag without a value."""
    return value(flag, text, *names, section=section, is_flag=True)


def path_option(
    flag: str, text: str, *names: str, section: str = INFORMATION, **known: Any
) -> Decorator:
    """A flag whose value is a file, or with ``type=MESH`` a mesh."""
    known = {"type": FILE, "metavar": "FILE"} | known
    return value(flag, text, *names, section=section, **known)


class Command(click.Command):
    """A command that also takes the older names of its flags."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put today's name in the place of an older one, then read on as click does."""
        return super().parse_args(ctx, [today(word) for word in args])


class SectionedCommand(Command):
    """A command with so many flags that its help text has sections."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """One list of flags a section."""
        rows: dict[str, list[tuple[str, str]]] = {name: [] for name in SECTIONS}
        for param in self.get_params(ctx):
            if not isinstance(param, click.Option):
                continue
            record = param.get_help_record(ctx)
            if record is not None:
                rows[getattr(param, "section", INFORMATION)].append(record)
        for name, records in rows.items():
            if records:
                with formatter.section(name):
                    formatter.write_dl(records)


def today(word: str) -> str:
    """A word of the command line, an older flag (also ``--flag=value``) by the name it has today."""
    flag, sign, value = word.partition("=")
    return OLDER_FLAGS.get(flag, flag) + sign + value


class Listed(click.ParamType[Any]):
    """A value for which some words are known, read when they are needed; the shell completes them."""

    name = "name"

    def __init__(self, names: Callable[[], Sequence[str]]) -> None:
        self.names = names

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Words that begin so."""
        return [CompletionItem(name) for name in self.names() if name.startswith(incomplete)]


class Name(Listed):
    """A name out of a table of the library, with did-you-mean.

    Text after a colon is the argument of the name and is not checked. ``listed``: the help shows all names.
    """

    def __init__(self, kind: str, names: Callable[[], list[str]], listed: bool = False) -> None:
        super().__init__(names)
        self.kind, self.listed = kind, listed

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value, where the table has it."""
        names = list(self.names())
        if str(value).partition(":")[0] not in names:
            self.fail(unknown_name(self.kind, str(value), names), param, ctx)
        return value

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """The word for the help text."""
        return f"[{'|'.join(self.names())}]" if self.listed else self.kind.upper()


class FiniteRange(click.FloatRange):
    """A range of numbers; click's own lets ``nan`` through, which is outside no range."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number, where it is one."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a number", param, ctx)
        return number


class NumberOr(Listed):
    """A number, or a word in place of one. Unknown words go to the library where numbers need not be whole."""

    name = "number"

    def __init__(self, words: Sequence[str], whole: bool) -> None:
        super().__init__(lambda: words)
        self.words, self.whole = words, whole

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The word or the number."""
        if isinstance(value, (int, float)) or (self.whole and value in self.words):
            return value
        try:
            return int(value) if self.whole else float(value)
        except ValueError:
            if self.whole:
                word = self.words[0]
                self.fail(f"{value!r} is neither a whole number nor {word!r}.", param, ctx)
            return value


# unreadable files and directories are errors of the library (exit 3), not of usage
MESH = click.Path(dir_okay=True, allow_dash=True, readable=False)
FILE = click.Path(readable=False)

# options of the library ------------------------------------------------------------------------------
_TYPES = (int, float, str)  # every other type is in a file


def library_option(name: str, fields: Any = Options, **other: Any) -> Decorator:
    """The flag of one field of ``fields``, a dataclass of options; ``other`` goes to click instead.

    The parameter of the command has the name of the field, and is None where the option is not given.
    """
    spec = specs(fields)[name]
    own = next(f for f in dataclasses.fields(fields) if f.name == name)
    types = types_of(fields)[name]
    section = next((s for s, stages in SECTIONS.items() if spec.stage in stages), INFORMATION)
    flag = spec.flag or "--" + name.replace("_", "-")
    words = filter(None, (spec.short, name))
    known: dict[str, Any] = {"metavar": spec.metavar}
    if bool in types:
        known["is_flag"], known["flag_value"] = True, not spec.switches_off
        known["default"] = own.default if "/" in spec.flag else None
    elif spec.words:
        known["type"] = NumberOr(tuple(spec.words), whole=False)
    elif spec.word:
        known["type"] = NumberOr((spec.word,), whole=True)
    elif spec.names is not None:
        known["type"] = Name(name, spec.names)
    else:
        plain = next((kind for kind in _TYPES if kind in types), FILE)
        known["type"] = click.Choice(spec.choices) if spec.choices else plain
    text = other.pop("help", spec.text)
    return value(flag, text, *words, section=section, **(known | other))


def library_options(stage: str, fields: Any = Options) -> list[Decorator]:
    """The flags of all fields of a stage, in their order."""
    return [library_option(n, fields) for n, spec in specs(fields).items() if spec.stage == stage]


def library_keywords(given: dict[str, Any], fields: Any = Options) -> dict[str, Any]:
    """Options of the library given on the command line, by the names of their fields."""
    return {name: given[name] for name in specs(fields) if given.get(name) is not None}


def echo_json(document: Any, indent: int | None = None) -> None:
    """JSON on standard output, always UTF-8: bytes of names that are none become escapes (``\\udcff``)."""
    text = json.dumps(document, indent=indent, ensure_ascii=False, allow_nan=False)
    click.echo(text.encode("utf-8", "backslashreplace").decode())


def show(
    given: dict[str, Any], report: Any, shown: Callable[[], Any] | None, indent: int | None = None
) -> None:
    """The report as JSON, else what ``shown`` gives, text or tables; nothing with --quiet, or for None."""
    if given["as_json"]:
        echo_json(report, indent)
    elif not given.get("quiet") and shown is not None:
        found = shown()
        if isinstance(found, str):
            click.echo(found)
        else:
            tables.console().print(*found)


def print_messages(
    given: dict[str, Any], place: str, warnings: Iterable[str], notes: Iterable[str] = ()
) -> None:
    """Warnings and notes on stderr, one line each behind ``place``."""
    for line in warnings:
        progress.say("warning", place + line, given["quiet"])
    for line in notes:
        progress.say("note", place + line, given["quiet"])


def check_gates(gates: Any, report: dict[str, Any], about: str) -> None:
    """Raise GateError where a report misses a gate of --fail-if."""
    if missed := gates.missed(report):
        raise GateError(f"{about}: --fail-if {'; '.join(missed)}")


def finish_unwrap(
    given: dict[str, Any], gates: Any, report: dict[str, Any], mesh: str, out: str
) -> None:
    """Show the report of one unwrapped or packed mesh, with no table where the mesh itself went to stdout.

    Raises GateError where the report misses a gate.
    """
    print_messages(given, f"{mesh}: ", report["warnings"])
    table = None if out == "-" else lambda: [tables.unwrap_table(report, given["verbose"])]
    show(given, report, table)
    check_gates(gates, report, mesh)


def complain(about: str, error: BaseException, several: bool = False) -> int:
    """Print the error of one mesh, alone or of several, for commands that go on; its exit code."""
    progress.say("error", exits.line_about(about, error, several))
    return exits.exit_of(error)[0]


# options of the command line alone ----------------------------------------------------------------------
json_option = switch("--json", "Print JSON on stdout.", "as_json")

overwrite = library_option("overwrite")

atlas_groups = value(
    "--group-by",
    "What shares an atlas.  [default: as the file says]",
    type=click.Choice(["primitive", "mesh", "scene"]),
)

quiet = switch("--quiet", "Print no progress, no table, no warnings.", "-q")

verbose = click.option("--verbose", "-v", count=True, help="Show more: -v stages, -vv notes.")

output = path_option("--output", "File to write.", "-o", section=INPUT)


def required_output(text: str) -> Decorator:
    """Where to write, for commands that have no name of their own to give."""
    return path_option("--output", text, "-o", required=True)


out_dir = path_option(
    "--out-dir", "Folder for the outputs, named as the inputs; created if missing.", metavar="DIR",
    section=INPUT,
)  # fmt: skip

_format = Name("format", lambda: formats.FORMATS.names(), listed=True)

format_option = library_option("format", type=_format)

named_format_option = library_option(
    "format", type=_format, help="Format of '-' (stdin, stdout), and of outputs without -o."
)

gates = value(
    "--fail-if",
    "Exit 6 if a condition on a figure or the status holds, such as 'degraded,distortion>1.05'.",
    section=CHECKS,
    metavar="GATES",
)


# of commands that read meshes, write a file and report on it
reporting = (library_option("reader"), overwrite, json_option, quiet)


def apply(*options: Decorator | Sequence[Decorator]) -> Decorator:
    """Several options as one decorator, in the order in which the help shows them."""
    flat = [o for item in options for o in (item if isinstance(item, Sequence) else [item])]

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(flat):
            function = option(function)
        return function

    return decorate
