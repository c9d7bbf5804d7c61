"""``circparam bake``: colours, a texture, normals or heights, carried into the new uv."""

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
  circparam bake low_uv.obj --from normals --source high.ply --map nearest --cage 0.05 -o low.glb
  circparam bake a_uv.obj --from texture --source b.glb --map a_to_b.npz -o a.png
"""


@click.command(epilog=_EPILOG)
@click.argument("mesh", type=common.MESH)
@click.option(
    "--from",
    "kind",
    type=click.Choice(["texture", "vertex-colors", "colours", "normals", "height"]),
    required=True,
    help="What to carry over; colours and vertex-colors are the same, normals are in tangent space.",
)
@click.option(
    "--source",
    type=common.MESH,
    metavar="OTHER",
    help="The file that has them: the mesh before it was unwrapped, or another mesh.",
)
@click.option(
    "--map",
    "by",
    type=common.FILE,
    metavar="MAP",
    help="Where places of MESH lie on OTHER: a file of circparam map (.npz), or nearest: along smooth normals.",
)
@click.option(
    "--cage",
    type=float,
    metavar="D",
    help="How far nearest looks, out and in, in units of the mesh.  [default: 2 % of its diagonal]",
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
@common.library_option("up")
@common.required_output("An image (.png), or the mesh with the image inside (.glb).")
@common.library_option("reader")
@common.overwrite
@common.json_option
@common.quiet
def command(mesh: str, **given: Any) -> None:
    """Carry colours, an old texture, or the shape of another mesh into the uv of a mesh.

    Where MESH and OTHER hold the same triangles, colours go from face to face; otherwise every texel takes
    the colour of the closest point of OTHER, or of the place that --map tells. Texels are grown into the
    padding. Normals are those of glTF: tangents by MikkTSpace, green up; heights are grey of 16 bit, level in
    the middle.
    """
    from circparam.bake.bake import Across, bake_document, check_across
    from circparam.bake.write import check_target, check_up, write_baked
    from circparam.core.monitor import Monitor
    from circparam.formats.io import read
    from circparam.maps.surface_map import load_map

    path = Path(given["output"])
    kind = "vertex-colors" if given["kind"] == "colours" else given["kind"]
    uv_set, size, by, far = (given[name] for name in ("uv_set", "size", "by", "source"))
    check_target(path, kind)
    check_place(str(path), given["overwrite"])
    check_across(kind, far is not None, Across("nearest" if by else None, given["cage"]))
    across = Across(by if by in (None, "nearest") else load_map(by), given["cage"])
    document = read(mesh, reader=given["reader"])
    up = None if given["up"] == "auto" else given["up"]
    check_up(path, document, up)
    other = read(far, reader=given["reader"]) if far is not None else None
    with progress.listener(Path(mesh).name, given["quiet"]) as listener:
        baked = bake_document(
            document, kind, uv_set=uv_set, source=other, across=across, size=size,
            monitor=Monitor(listener),
        )  # fmt: skip
    files, notes = write_baked(path, baked, document, uv_set, kind, up)
    for line in [*document.warnings, *document.notes, *baked.notes, *notes]:
        progress.warn(f"{mesh}: {line}", given["quiet"])
    report: dict[str, Any] = {
        "schema": "circparam/bake/1",
        "input": mesh,
        "output": [str(f) for f in files],
        "size": size,
        "covered": baked.covered,
        **baked.report,
        "notes": [*baked.notes, *notes],
    }
    if given["as_json"]:
        common.echo_json(report)
    elif not given["quiet"]:
        click.echo("\n".join(str(f) for f in files))
