"""``circparam batch``: many files, on all cores or on a cluster, with a manifest to continue from."""

import copy
import dataclasses
import json
from typing import TYPE_CHECKING, Any

import click

from circparam.cli import common, exits, progress, signals
from circparam.cli.paths import ENDINGS, check_ending
from circparam.cli.unwrap import (
    UnwrapCommand,
    library_options_of,
    look_options_of,
    memory_size,
)
from circparam.cli.unwrap import command as unwrap_command
from circparam.errors import GateError, InputError, OptionError

if TYPE_CHECKING:
    from circparam.batch.run import BatchPlan

CLEARING_SECONDS = 4.0  # seconds for the end of the workers and for their folders
_EPILOG = """\b
Examples:
  circparam batch meshes --out unwrapped
  circparam batch 'scans/**/*.ply' @more.txt --out unwrapped --timeout 120
  circparam batch meshes --out unwrapped --max-memory 4G
  circparam batch s3://b/in --out s3://b/out --scheduler tcp://head:8786
  circparam batch meshes --out unwrapped --retry failed --fail-rate 0.02
  circparam batch --status unwrapped
"""
# of unwrap, but not of a batch: it has --out, reads no stream, and gives each mesh a process and an atlas
_NOT_HERE = {"meshes", "output", "out_dir", "format", "jobs", "one_atlas"}
_HELP = {
    "export_seams": "Write the seams of each file, such as '{}.seams.txt' ({}: name of the result).",
    "index_map": "Write the index map of each file, such as '{}.npz'.",
    "preview": "Draw each result, such as '{}.png'.",
    "overwrite": "Replace results that no batch has written.",
    "timeout": "Return the best valid result within this time; end a mesh at 1.5 times it.",
    "max_memory": "Upper bound on the memory of one mesh, such as 4G.",
    "json": "Print a summary as JSON on stdout.",
    "verbose": "Print a line for each file that is done.",
}


def _unwrap_options() -> list[click.Parameter]:
    """The options of ``unwrap``, with the help text of batch."""
    out = []
    for param in unwrap_command.params:
        if param.name in _NOT_HERE or param.name == "debug":
            continue
        param = copy.copy(param)
        text = _HELP.get(str(param.name).removeprefix("as_"))
        if text and isinstance(param, click.Option):
            param.help = text
            param.metavar = "PATTERN" if param.name in common.FURTHER else param.metavar
        out.append(param)
    return out


@click.command(cls=UnwrapCommand, epilog=_EPILOG)
@click.argument("sources", metavar="SOURCE...", nargs=-1)
@click.option(
    *("-o", "--out", "--out-dir", "out"),
    metavar="DIR",
    help="Folder for the results: local, or an fsspec address.",
)
@common.value(
    "--workers",
    "Meshes unwrapped at the same time on this machine.  [default: cores]",
    *("-j", "--jobs", "workers"),
    type=click.IntRange(1, 10000),
    metavar="N",
)
@click.option("--scheduler", metavar="ADDRESS", help="Use the Dask cluster of this scheduler.")
@common.path_option("--scheduler-file", "Use the Dask cluster that this file names.")
@common.value(
    "--retry",
    "Run these files again.",
    multiple=True,
    type=click.Choice(["failed", "degraded", "all"]),
)
@common.value(
    "--fail-rate",
    "Exit 6 if more than this share failed or missed a gate.  [default: 0]",
    type=common.FiniteRange(0.0, 1.0),
    metavar="SHARE",
    default=0.0,
)
@common.path_option("--status", "Show the progress of a batch.", "status_of", metavar="DIR")
def command(sources: tuple[str, ...], **given: Any) -> int:
    """Unwrap many files, each in a process of its own, with one line each in DIR/manifest.jsonl.

    SOURCE: files, folders, globs, @list.txt, fsspec addresses. Their tree is mirrored under DIR. Run the same
    command again to continue: files that are done and unchanged are skipped. DIR/report.html shows the
    results. Needs circparam[batch].
    """
    if given["status_of"] is not None:
        if sources or given["out"] is not None:
            raise OptionError("--status DIR takes no other argument: it only reports")
        from circparam.batch.batch import status
        from circparam.cli.batch_progress import print_status

        try:
            found = status(given["status_of"])
        except OSError as error:
            raise InputError(f"{given['status_of']}: {error.strerror or error}") from None
        _print(found) if given["as_json"] else print_status(found)
        return exits.OK
    plan = _plan(sources, given)
    from circparam.batch.batch import run_batch
    from circparam.batch.run import Hooks
    from circparam.cli.batch_progress import Screen

    screen = Screen(given["quiet"] or given["as_json"], given["verbose"], given["quiet"])
    hooks = Hooks(
        screen.show,
        screen.line,
        lambda text: progress.say("warning", text, given["quiet"]),
        screen.started,
    )
    try:
        with signals.within(signals.GRACES, CLEARING_SECONDS):
            summary = run_batch(plan, hooks)
    finally:
        screen.close()
    from circparam.cli.batch_progress import print_summary

    if given["as_json"]:
        _print({"schema": "circparam/batch-summary/1", **dataclasses.asdict(summary)})
    elif not given["quiet"]:
        print_summary(summary)
    if not summary.finished:
        left = summary.total - sum(summary.counts.values())
        said = f"{left} of {summary.total} files are not done; the same command continues"
        progress.say("error", f"interrupted: {said}")
        return exits.INTERRUPTED
    if summary.fail_rate > given["fail_rate"]:
        bad = summary.counts.get("failed", 0) + summary.missed
        raise GateError(
            f"{bad} of {summary.total} files failed or missed a gate ({100 * summary.fail_rate:.3g} %), more "
            f"than --fail-rate {given['fail_rate']:g}: see {summary.report}, or give --retry failed"
        )
    return exits.OK


command.params += _unwrap_options()


def _plan(sources: tuple[str, ...], given: dict[str, Any]) -> "BatchPlan":
    """The plan of a batch from the command line. Raises OptionError before anything is listed."""
    if not sources:
        raise OptionError("SOURCE is missing: name files, folders, globs or @list.txt")
    if given["out"] is None:
        raise OptionError("--out DIR is missing: the folder for the results")
    engines = [n for n in ("workers", "scheduler", "scheduler_file") if given[n] is not None]
    if len(engines) > 1:
        flags = " and ".join("--" + n.replace("_", "-") for n in engines)
        raise OptionError(f"{flags} exclude each other: use local workers or one running cluster")
    if "-" in sources:
        raise OptionError("a batch cannot read standard input: give '-' to circparam unwrap")
    from circparam.batch.run import BatchPlan
    from circparam.batch.settings import Settings
    from circparam.pipeline.gates import parse_gates
    from circparam.pipeline.options import Options

    for name, flag in common.FURTHER.items():
        if given[name]:
            check_ending(f"--{flag} {given[name]}", *ENDINGS.get(name, ()))
    size = given["max_memory"]
    options, look = Options(**library_options_of(given)), look_options_of(given)
    if look is not None:
        from circparam.bake.rebake import check_page

        check_page(options)
    settings = Settings(
        options=options,
        gates=parse_gates(given["fail_if"]),
        out=given["out"],
        exit_of=exits.exit_of,
        look=look,
        extras={flag: given[name] for name, flag in common.FURTHER.items() if given[name]},
        max_memory=None if size is None else memory_size(size),
    )
    return BatchPlan(
        sources, settings, frozenset(given["retry"]),
        given["workers"], given["scheduler"], given["scheduler_file"],
    )  # fmt: skip


def _print(document: dict[str, Any]) -> None:
    """One line of JSON that any terminal and any shell can take."""
    click.echo(json.dumps(document, ensure_ascii=True, allow_nan=False))
