"""``circparam bake``: vertex colours or a texture, carried into the new uv."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from circparam.cli import common, progress
from circparam.cli.paths import check_place
from circparam.core.limits import RESOLUTION

_EPILOG = """\b
Examples:
  circparam bake scan_uv.ply --from vertex-colors -o scan.png
  circparam bake spot_uv.obj --from texture --source spot.obj -o spot_new.png
  circparam bake model_uv.glb --from texture --source scan.obj -o model.glb
  circparam bake model.glb --from texture --uv-set 1 --size 1024 -o baked.png
"""


@click.command(epilog=_EPILOG)
@click.argument("mesh", type=common.MESH)
@click.option(
    "--from",
    "kind",
    type=click.Choice(["vertex-colors", "texture"]),
    required=True,
    help="What to carry over.",
)
@click.option(
    "--source",
    type=common.MESH,
    metavar="OTHER",
    help="The file that has the colours: the mesh before it was unwrapped, or another mesh.",
)
@click.option(
    "--size",
    type=click.IntRange(int(RESOLUTION.low), int(RESOLUTION.high)),
    default=2048,
    show_default=True,
    metavar="TEXELS",
    help="Side of the image.",
)
@click.option(
    "--uv-set",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    metavar="N",
    help="The uv set of MESH to bake into.",
)
@click.option(
    "--output",
    "-o",
    type=common.FILE,
    metavar="FILE",
    required=True,
    help="An image (.png), or the mesh with the image inside (.glb).",
)
@common.library_option("reader")
@common.overwrite
@common.json_option
@common.quiet
def command(mesh: str, **given: Any) -> None:
    """Carry vertex colours or an old texture into the uv of a mesh, so that the new atlas can be used at once.

    Where MESH and OTHER hold the same triangles, colours go from face to face; otherwise every texel takes
    the colour of the closest point of OTHER. Colours are grown into the padding.
    """
    from circparam.bake.bake import bake_document
    from circparam.bake.write import check_target, write_baked
    from circparam.core.monitor import Monitor
    from circparam.formats.io import read

    path = Path(given["output"])
    check_target(path)
    check_place(str(path), given["overwrite"])
    document = read(mesh, reader=given["reader"])
    kind, uv_set, size = given["kind"], given["uv_set"], given["size"]
    other = read(given["source"], reader=given["reader"]) if given["source"] is not None else None
    with progress.listener(Path(mesh).name, given["quiet"]) as listener:
        baked = bake_document(
            document, kind, uv_set=uv_set, source=other, size=size, monitor=Monitor(listener)
        )
    files, notes = write_baked(path, baked, document, uv_set, kind)
    for line in [*document.warnings, *document.notes, *baked.notes, *notes]:
        progress.warn(f"{mesh}: {line}", given["quiet"])
    report: dict[str, Any] = {
        "schema": "circparam/bake/1",
        "input": mesh,
        "output": [str(f) for f in files],
        "size": size,
        "covered": baked.covered,
        "notes": [*baked.notes, *notes],
    }
    if given["as_json"]:
        common.echo_json(report)
    elif not given["quiet"]:
        click.echo("\n".join(str(f) for f in files))
