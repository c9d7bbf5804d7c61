"""The group of all commands: the table ``COMMANDS``, and the options that all commands share.

A command is one module and one row. ``circparam --help`` reads only the summaries of the table, so it needs
neither NumPy nor trimesh. An error becomes one line and a documented code here and nowhere else.
"""

import contextlib
import importlib
import io
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from circparam._version import __version__
from circparam.cli import exits, signals
from circparam.core.memory import room_for_libraries
from circparam.core.registry import did_you_mean
from circparam.core.workers import cores

ALONE = {"-h", "--help", "-V", "--version"}  # options without a command need no library


# a line of the help for each command, which is ``command`` in ``circparam.cli.NAME``
COMMANDS = {
    "unwrap": "Give meshes a uv layout: cut, flatten, pack, write the file back.",
    "batch": "Unwrap thousands of files on all cores or a cluster; continue when stopped.",
    "check": "Report topology and the quality of uv.",
    "pack": "Pack the charts of a file again without changing them.",
    "compare": "Compare several methods on the identical cut.",
    "view": "Draw layout, checker and distortion as PNG, SVG or HTML.",
    "map": "Map one surface onto another, one to one, landmark to landmark.",
    "transfer": "Give the layout of one mesh to its other levels of detail.",
    "bake": "Bake colours, textures, normals or heights into the uv of a mesh.",
    "morph": "Write one mesh as a morph target of another, with an animation.",
    "methods": "Show every method and its guarantees.",
    "samples": "List the bundled meshes, or save one.",
    "blender": "Save the add-on for Blender.",
}

_EPILOG = """\b
Examples:
  circparam unwrap mesh.obj
  circparam unwrap mesh.glb -o out.glb --json
  circparam check mesh.obj
  circparam COMMAND --help
"""


_DEBUG: Any = {
    "is_flag": True, "expose_value": False, "help": "Show the traceback of an error.",
}  # fmt: skip


class LazyGroup(click.Group):
    """A group whose commands are imported when they are called, and whose errors are one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands, in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command; None if there is none of that name."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"circparam.cli.{cmd_name}")
        command: click.Command = module.command
        if not any(p.name == "debug" for p in command.params):
            command.params.append(click.Option(["--debug"], **_DEBUG))
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with a did-you-mean for an unknown command."""
        if args and args[0] not in self.list_commands(ctx) and not args[0].startswith("-"):
            names = self.list_commands(ctx)
            cure = did_you_mean(args[0], names, f"choose {', '.join(names)}")
            if os.path.exists(args[0]):
                cure = f"to unwrap that file: circparam unwrap {args[0]}"
            raise click.UsageError(f"no command {args[0]!r}: {cure}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The summaries of the table, without importing a command."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        **extra: Any,
    ) -> Any:
        """Run; in standalone mode exit with a documented code and at most one line about the error."""
        if not standalone_mode:
            return super().main(args, prog_name, complete_var, False, **extra)
        argv = list(sys.argv[1:] if args is None else args) or ["--help"]
        for name, mode, flags in (
            ("stdin", "r", os.O_RDONLY),
            ("stdout", "w", os.O_RDONLY),
            ("stderr", "w", os.O_WRONLY),
        ):
            if getattr(sys, name) is None:
                setattr(sys, name, os.fdopen(os.open(os.devnull, flags), mode))
        # names of files may be any bytes: they go out as they came in
        if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
            sys.stdout.reconfigure(errors="surrogateescape")
        with signals.installed():
            code = self._run(argv, complete_var, extra)
            if pool := sys.modules.get("circparam.core.pool"):  # nothing more is asked of workers
                pool.stop()
        sys.exit(code)

    def _run(self, argv: list[str], complete_var: str | None, extra: dict[str, Any]) -> int:
        stdout, stderr = sys.stdout, sys.stderr
        try:
            if argv and argv[0] not in ALONE:
                room_for_libraries(cores())
            value = super().main(argv, "circparam", complete_var, False, **extra)
            sys.stdout.flush()
        except click.ClickException as error:
            line = " ".join(error.format_message().split())
            if (context := getattr(error, "ctx", None)) is not None:  # the help to look at
                line += "" if line.endswith((".", "?", "!")) else "."
                line += f" See: {context.command_path} --help"
            _complain(line)
            return exits.USAGE if isinstance(error, click.UsageError) else exits.INTERNAL
        except (click.Abort, KeyboardInterrupt):
            return _report(KeyboardInterrupt())
        except SystemExit as error:
            if sys.stdout is not stdout:  # click replaces it where the reader of a pipe has gone
                sys.stdout, sys.stderr = stdout, stderr
                return _report(BrokenPipeError())
            return error.code if isinstance(error.code, int) else exits.INTERNAL
        except BaseException as error:
            if "--debug" in argv:
                raise
            return _report(error)
        return value if isinstance(value, int) else exits.OK


def _report(error: BaseException) -> int:
    """One line about an error; returns its exit code."""
    if isinstance(error, OSError):  # the interpreter writes to that pipe or full disk at its end
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    code, line = exits.exit_of(error)
    _complain(line)
    return code


def _complain(line: str) -> None:
    with contextlib.suppress(OSError, ValueError):
        click.echo(f"circparam: error: {line}", err=True)


@click.group(
    cls=LazyGroup,
    epilog=_EPILOG,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, "-V", "--version", prog_name="circparam")
@click.option("--debug", **_DEBUG)
def cli() -> None:
    """Unwrap triangle meshes: few charts, bounded distortion, no flips, lossless files."""


def main() -> NoReturn:
    """The entry point of the ``circparam`` script."""
    cli.main()
    raise AssertionError("click's main exits")
