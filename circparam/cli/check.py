"""``circparam check``: what a mesh is, and what its uv are worth."""

from __future__ import annotations

from typing import Any

import click

from circparam.cli import common, progress

_EPILOG = """\b
Examples:
  circparam check mesh.obj
  circparam check mesh.glb --uv --json
  circparam check mesh.obj --require disk && circparam unwrap mesh.obj --cut none
  circparam check mesh.glb --uv --fail-if 'flips>0,overlap>0'
"""


@click.command(epilog=_EPILOG)
@click.argument("mesh", metavar="MESH", type=common.MESH)
@common.apply(
    click.option("--uv", is_flag=True, help="Judge the uv that the file has."),
    common.library_option("uv_set"),
    common.library_option("resolution"),
    common.library_option("padding"),
    click.option(
        "--require", type=click.Choice(["disk"]), help="Exit 4 unless every component is one."
    ),
    common.library_option("weld"),
    common.gates,
    common.format_option,
    common.json_option,
    common.quiet,
)
def command(mesh: str, **given: Any) -> None:
    """Report topology, and with --uv judge a uv set that is there.

    Vertices, faces, components, Euler characteristic, genus, boundaries, what is non-manifold, degenerate,
    duplicate or wound inconsistently; with --uv flips, overlaps, mirrored charts, distortion, seams, packing.
    """
    from circparam.errors import GateError, OptionError
    from circparam.formats.io import read
    from circparam.pipeline.gates import parse_gates
    from circparam.pipeline.inspect import inspect, require_disks
    from circparam.pipeline.summary import summarise_check

    judge_uv = given["uv"] or given["uv_set"] is not None
    for name in ("resolution", "padding", "fail_if"):
        if given[name] is not None and not judge_uv:
            raise OptionError(f"--{name.replace('_', '-')} has no effect without --uv")
    gates = parse_gates(given["fail_if"])
    keywords = {k: given[k] for k in ("weld", "resolution", "padding") if given[k] is not None}
    if judge_uv:
        keywords["uv_set"] = given["uv_set"] or 0
    with progress.listener(mesh, given["quiet"]):
        found = inspect(read(mesh, format=given["format"]), **keywords)
    report = summarise_check(found)
    if given["as_json"]:
        common.echo_json(report)
    elif not given["quiet"]:
        from circparam.cli.tables import check_table, console

        console().print(check_table(report))
    if given["require"] == "disk":
        require_disks(found)
    missed = gates.missed(report["uv"] or {})
    if missed:
        raise GateError(f"{mesh}: --fail-if {'; '.join(missed)}")
