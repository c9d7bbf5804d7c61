"""``circparam pack``: the charts that a file has, laid out anew."""

from typing import Any

import click

from circparam.cli import common, progress
from circparam.cli.paths import check_outputs, output_path

_EPILOG = """\b
Examples:
  circparam pack mesh.obj                          writes mesh_uv.obj
  circparam pack mesh.glb -o packed.glb --resolution 4096 --padding 8
  circparam pack parts.obj --lock material=face    these charts stay
  circparam pack mesh.obj -o packed.obj --rotate none --fail-if 'pack<0.6'
"""


@click.command(epilog=_EPILOG)
@click.argument("mesh", metavar="MESH", type=common.MESH)
@common.apply(
    common.output,
    common.overwrite,
    common.named_format_option,
    common.library_option("reader"),
    common.library_options("packing"),
    common.library_option(
        "group_by",
        type=click.Choice(["material", "node", "group"]),
        help="Give each material, node or group a box on the page.",
    ),
    common.library_option("lock"),
    common.library_option("uv_set"),
    common.library_option("ply_uv"),
    common.library_option("up"),
    common.library_option("copy_assets"),
    common.gates,
    common.library_option("jobs"),
    common.json_option,
    common.quiet,
    common.verbose,
)
def command(mesh: str, **given: Any) -> None:
    """Pack the charts of a file again without changing their shapes.

    Every chart keeps its shape and its size relative to the others; none is mirrored. At least --padding
    texels stay empty between charts and at the border of the page.
    """
    from circparam.cli.unwrap import with_files
    from circparam.pipeline.gates import parse_gates
    from circparam.pipeline.summary import summarise
    from circparam.pipeline.unwrap import repack

    gates = parse_gates(given["fail_if"])
    out = output_path(mesh, given)
    check_outputs((mesh,), [out], given)
    keywords = with_files(common.library_keywords(given))
    if "-" not in (mesh, out):  # it named the output
        keywords.pop("format", None)
    if mesh == "-" and given["format"] is None:
        raise click.UsageError("'-' (stdin) needs its format: give --format obj, ply, glb ...")
    with progress.listener(mesh, given["quiet"]) as listener:
        report = summarise(repack(mesh, out, listener=listener, **keywords))
    common.finish_unwrap(given, gates, report, mesh, out)
