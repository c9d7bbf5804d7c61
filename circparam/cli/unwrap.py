"""``circparam unwrap``: the whole way from a mesh file to the same file with uv."""

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from circparam.cli import common, exits, progress
from circparam.cli.paths import (
    check_one_atlas,
    check_outputs,
    made_folder,
    output_path,
    without_outputs,
)
from circparam.core.imports import OnDemand, put_off
from circparam.core.memory import bound_process, room_for_libraries
from circparam.core.workers import cores
from circparam.errors import CircparamError, GateError, OptionError
from circparam.pipeline.options import LookOptions, Options

_EPILOG = """\b
Examples:
  circparam unwrap mesh.obj                          writes mesh_uv.obj
  circparam unwrap mesh.glb -o out.glb --json
  circparam unwrap *.obj --out-dir unwrapped
  circparam unwrap model.glb --rebake                carries textures along
  circparam unwrap mesh.obj model.glb --one-atlas --out-dir both
  circparam unwrap disk.obj --cut disk --method circle
  circparam unwrap mesh.obj --max-distortion 1.02 --fail-if 'flips>0'
  circparam unwrap - --format obj < mesh.obj > mesh_uv.obj

\b
Figures of the report:
  distortion    mean symmetric Dirichlet energy / 4; 1 is perfect
  seam length   length of all seams, in roots of the surface area
  stretch       largest stretch or shrink of the surface in one direction
  packed        share of the pages that charts cover
"""


class UnwrapCommand(common.SectionedCommand):
    """A command whose ``--boundary polygon FILE`` takes the file after the name."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Join ``--boundary polygon FILE`` to one value before click reads the rest."""
        joined: list[str] = []
        words = iter(args)
        for word in words:
            joined.append(word)
            if common.today(word) == "--boundary":
                value = next(words, "")
                if value == "polygon":
                    value = f"polygon:{next(words, '')}"
                joined.append(value)
        return super().parse_args(ctx, joined)


@click.command(cls=UnwrapCommand, epilog=_EPILOG)
@click.argument("meshes", metavar="MESH...", nargs=-1, required=True, type=common.MESH)
@common.apply(
    common.output,
    common.out_dir,
    common.overwrite,
    common.named_format_option,
    common.library_option("reader"),
    common.library_option("method"),
    common.library_options("flattening"),
    common.library_options("seams"),
    common.path_option(
        "--export-seams", "Write the seams as vertex pairs, counted from 0.", section=common.SEAMS
    ),
    common.library_options("packing"),
    common.switch(
        "--one-atlas",
        "Put all meshes on shared pages, with --rebake on shared images; needs --out-dir.",
        section=common.PACKING,
    ),
    common.switch(
        "--rebake",
        "Carry every texture of every material into the new uv.",
        section=common.TEXTURES,
    ),
    common.library_options("look", LookOptions),
    common.library_options("writing"),
    common.path_option(
        "--map", "Write the index map.", "index_map", metavar="FILE.npz", section=common.INPUT
    ),
    common.library_options("repair"),
    common.gates,
    common.library_option("timeout"),
    common.library_option("checkpoint"),
    common.library_option("jobs"),
    common.value(
        "--max-memory", "Upper bound on memory, such as 4G.", section=common.CHECKS, metavar="SIZE"
    ),
    common.path_option("--preview", "Draw the result: .png, .svg or .html.", section=common.INPUT),
    common.json_option,
    common.quiet,
    common.verbose,
)
def command(meshes: tuple[str, ...], **given: Any) -> int:
    """Give meshes a uv layout and write them back, with everything else unchanged.

    Cuts the surface into charts of bounded distortion, flattens and packs them, writes the file, reads it
    back and verifies it: no flips, no overlaps, no mirrored charts. Without -o the output is MESH_uv.EXT
    beside the input.
    """
    from circparam.pipeline.gates import parse_gates

    run = _Run(given, parse_gates(given["fail_if"]))
    if given["one_atlas"]:
        check_one_atlas(meshes, given)
    asked, again = without_outputs(meshes)
    outputs = [output_path(mesh, given) for mesh in asked]
    check_outputs(asked, outputs, given)
    for mesh in again:
        line = f"{mesh}: skipped, because it is the output of another mesh"
        progress.say("warning", line, run.quiet)
    codes = []
    with made_folder(given["out_dir"]):
        if given["one_atlas"]:
            failed = {"schema": "circparam/atlas/1", "input": asked}
            return run.attempt("--one-atlas", run.together, asked, outputs, **failed)
        for k, (mesh, out) in enumerate(zip(asked, outputs, strict=True), 1):
            run.place = (k, len(asked))
            codes.append(run.attempt(mesh, run.one, mesh, out, input=mesh))
    run.summary()
    return next((code for code in codes if code), exits.OK)


sidecars: Any = OnDemand("circparam.formats.sidecars")  # workers start before it is imported
# options that may name a file, and its reader
READERS = {
    **{"pins": "read_pins", "seams": "read_seams", "no_seams": "read_seams"},
    **{"seam_weights": "read_weights", "only": "read_faces", "lock": "read_faces"},
}


class _Run:
    """One call of the command: data that all its meshes share."""

    def __init__(self, given: dict[str, Any], gates: Any) -> None:
        self.given, self.gates = given, gates
        self.started: float | None = time.monotonic()  # the first mesh pays for the imports
        self.place = (1, 1)  # number of the mesh, and of all
        self.quiet, self.as_json, self.format = (given[k] for k in ("quiet", "as_json", "format"))
        self.reading = {name: given[name] for name in ("unshare", "reader")}
        if given["max_memory"] is not None:
            bound_process("AS", memory_size(given["max_memory"]))
            room_for_libraries(cores())
        put_off()  # before options that need the table of methods
        self.options = Options(**library_options_of(given))
        self.look = look_options_of(given)
        self.reports: list[dict[str, Any]] = []  # of every mesh, those without a result too

    def attempt(self, about: str, work: Callable[..., None], *args: Any, **failed: Any) -> int:
        """Do some work; an error of one mesh does not keep the others from being unwrapped.

        failed: what the report says if there is no result. Returns the exit code.
        """
        try:
            work(*args)
        except (CircparamError, MemoryError) as error:
            several = self.place[1] > 1
            code = common.complain(about, error, several)
            if not isinstance(error, GateError):
                from circparam.pipeline.summary import SCHEMA

                said = {"error": exits.line_about(about, error, several), "exit": code}
                known = {"schema": SCHEMA.format("unwrap"), "output": None, "status": "failed"}
                self.reports.append(known | said | failed)
                if self.as_json:
                    common.echo_json(self.reports[-1])
            return code
        return exits.OK

    def summary(self) -> None:
        """One line for each of several meshes with its result."""
        if len(self.reports) < 2 or self.as_json or self.quiet:
            return
        common.tables.console().print("", common.tables.summary_table(self.reports))

    def one(self, mesh: str, out: str) -> None:
        """Unwrap one mesh."""
        from circparam.pipeline.jobs import monitor_of, start_for_file

        started, self.started = self.started or time.monotonic(), None
        start_for_file(self.options, mesh)
        label, searches = os.path.basename(mesh), self.options.searches
        with progress.listener(label, self.quiet, self.place, searches) as listener:
            monitor = monitor_of(self.options, listener, started)
            from circparam.formats.io import read
            from circparam.pipeline.summary import summarise
            from circparam.pipeline.unwrap import unwrap_document

            with monitor.stage("read"):
                document = read(mesh, format=self.format if mesh == "-" else None, **self.reading)
            options = replace(self.options, format=self.format if out == "-" else None)
            named = {kind: self.given[name] for name, kind in common.FURTHER.items()}
            further = {kind: path for kind, path in named.items() if path}
            if self.look is None and not further:  # a plain unwrap starts without the other rooms
                report = summarise(unwrap_document(document, out, options, monitor))
            else:
                from circparam.batch.mesh import write_mesh

                _, report = write_mesh(document, out, options, self.look, further, monitor)
        self.reports.append(report)
        common.finish_unwrap(self.given, self.gates, report, mesh, out)

    def together(self, meshes: list[str], outs: list[str]) -> None:
        """Unwrap several meshes into one atlas."""
        from circparam.pipeline.jobs import monitor_of

        label, searches = f"{len(meshes)} meshes", self.options.searches
        with progress.listener(label, self.quiet, self.place, searches) as listener:
            monitor = monitor_of(self.options, listener, self.started)
            from circparam.formats.io import read

            with monitor.stage("read"):
                documents = [read(mesh, **self.reading) for mesh in meshes]
            places = [Path(out) for out in outs]
            if self.look is None:
                from circparam.pipeline.together import unwrap_documents

                report = unwrap_documents(documents, places, self.options, monitor).as_dict()
            else:
                from circparam.bake.together import rebake_documents

                shared, look = rebake_documents(documents, places, self.options, self.look, monitor)
                report = shared.as_dict() | look.figures()

        common.print_messages(self.given, "", report["warnings"])
        page = report | {"input": f"{len(meshes)} meshes", "output": self.given["out_dir"]}
        tables, verbose = common.tables, self.given["verbose"]
        shown = lambda: [tables.unwrap_table(page, verbose), "", tables.atlas_table(report)]  # noqa: E731
        common.show(self.given, report, shown)
        common.check_gates(self.gates, report, "--one-atlas")


def look_options_of(given: dict[str, Any]) -> LookOptions | None:
    """How textures are carried, None without --rebake. Raises OptionError if only --rebake gives a sense."""
    known = common.library_keywords(given, LookOptions)
    if given["rebake"]:
        return LookOptions(**known)
    for name in known:
        raise OptionError(
            f"--{name.replace('_', '-')} has no effect here: it needs --rebake; leave it out"
        )
    return None


def library_options_of(given: dict[str, Any]) -> dict[str, Any]:
    """The options of the library out of those of the command, files read.

    The format is left to the streams: it says nothing of meshes in files.
    """
    out = common.library_keywords(given)
    out.pop("format", None)
    return with_files(out)


def with_files(out: dict[str, Any]) -> dict[str, Any]:
    """Options of the library with the contents of their files."""
    boundary, _, corners = out.get("boundary", "").partition(":")
    if boundary == "polygon":
        out["boundary"] = boundary
        out |= {"polygon": sidecars.read_polygon(corners)} if corners else {}
    if out.get("bff_boundary", "disk") != "disk":
        out["bff_boundary"] = sidecars.read_column(out["bff_boundary"], "a length")
    for name, reader in READERS.items():
        if name in out and not _is_value(name, out[name]):
            out[name] = getattr(sidecars, reader)(out[name])
    return out


def _is_value(name: str, text: str) -> bool:
    """Whether the text of an option is its value and names no file."""
    if name in ("only", "lock"):
        from circparam.pipeline.selection import by_name

        return by_name(text)
    return name == "seam_weights" and text == "colour"


def memory_size(size: str) -> int:
    """Bytes out of a text such as 4G. Raises OptionError, also where memory cannot be bounded."""
    factor = {"K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
    text = size.strip().upper().removesuffix("B").removesuffix("I")
    unit = factor.get(text[-1:], 1)
    try:
        count = int(float(text[:-1] if text[-1:] in factor else text) * unit)
    except (ValueError, OverflowError):
        count = 0
    if count <= 0:
        raise OptionError(
            f"--max-memory {size!r} is not a size: write a number with K, M or G, such as 4G"
        )
    try:
        import resource  # noqa: F401
    except ImportError:
        raise OptionError("--max-memory is not available on this system: leave it out") from None
    return count
