"""``circparam check``: topology of a mesh and quality of its uv."""

from typing import Any

import click

from circparam.cli import common, exits, progress
from circparam.errors import CircparamError, OptionError

_EPILOG = """\b
Examples:
  circparam check mesh.obj
  circparam check mesh.glb --uv --json
  circparam check mesh.obj --require disk
  circparam check mesh.glb --uv --fail-if 'degraded,distortion>1.05'
  circparam check mesh.stl --fail-if 'genus>0,nonmanifold_edges>0'
  circparam check *.obj --uv
"""


@click.command(epilog=_EPILOG)
@click.argument("meshes", metavar="MESH...", nargs=-1, required=True, type=common.MESH)
@common.apply(
    common.switch("--uv", "Evaluate the uv of the file."),
    common.library_option("uv_set"),
    common.atlas_groups,
    common.library_option("resolution"),
    common.library_option("padding"),
    click.option(
        "--require", type=click.Choice(["disk"]), help="Exit 4 unless every component is a disk."
    ),
    common.library_option("weld"),
    common.gates,
    common.format_option,
    common.library_option("reader"),
    common.json_option,
    common.quiet,
)
def command(meshes: tuple[str, ...], **given: Any) -> int:
    """Report the topology of meshes and, with --uv, the quality of their uv.

    Topology: vertices, faces, components, Euler characteristic, genus, boundaries; non-manifold, degenerate,
    duplicate and inconsistently oriented parts. With --uv: flips, overlaps, mirrored charts, distortion,
    seams, packing. Several files get one line each.
    """
    from circparam.pipeline.gates import JUDGED, TOPOLOGY, parse_gates

    verify_uv = given["uv"] or given["uv_set"] is not None
    for name in ("resolution", "padding", "group_by"):
        if given[name] is not None and not verify_uv:
            raise OptionError(f"--{name.replace('_', '-')} has no effect without --uv")
    if len(meshes) > 1 and given["format"] is not None and "-" not in meshes:
        raise OptionError("--format has no effect here: it is for '-' (stdin); leave it out")
    gates = parse_gates(given["fail_if"], (*TOPOLOGY, *JUDGED))
    of_uv = sorted(gates.names() & {*JUDGED, "status"})
    if of_uv and not verify_uv:
        raise OptionError(f"--fail-if {of_uv[0]} judges uv: give --uv")
    keywords = {
        k: given[k] for k in ("weld", "resolution", "padding", "group_by") if given[k] is not None
    }
    if verify_uv:
        keywords["uv_set"] = given["uv_set"] or 0
    if len(meshes) == 1:
        _check(meshes[0], given, keywords, gates, table=True)
        return exits.OK
    codes = []
    for mesh in meshes:
        try:
            _check(mesh, given, keywords, gates, table=False)
        except (CircparamError, MemoryError) as error:
            codes.append(common.complain(mesh, error))
    return next(iter(codes), exits.OK)


def _check(
    mesh: str, given: dict[str, Any], keywords: dict[str, Any], gates: Any, *, table: bool
) -> None:
    """Report on one file, as a table or in one line."""
    from circparam.formats.io import read
    from circparam.pipeline.inspect import inspect, require_disks
    from circparam.pipeline.summary import summarise_check

    with progress.listener(mesh, given["quiet"]):
        format = given["format"] if table or mesh == "-" else None
        found = inspect(read(mesh, format=format, reader=given["reader"]), **keywords)
    report = summarise_check(found)
    if table:
        common.show(given, report, lambda: [common.tables.check_table(report)])
    else:
        common.show(given, report, lambda: f"{mesh}: {common.tables.check_line(report)}")
    if given["require"] == "disk":
        require_disks(found)
    common.check_gates(gates, {**report, **(report["uv"] or {})}, mesh)
