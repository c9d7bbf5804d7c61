"""``circparam bake``: colours, a texture, normals or heights, carried into the new uv."""

from pathlib import Path
from typing import Any

import click

from circparam.cli import common, progress
from circparam.cli.paths import check_output
from circparam.errors import OptionError
from circparam.pipeline.options import LookOptions

IMAGE_TEXELS = 2048  # texels on each side of an image by default

_EPILOG = """\b
Examples:
  circparam bake scan_uv.ply --from vertex-colors -o scan.png
  circparam bake spot_uv.obj --from texture --source spot.obj -o spot_new.png
  circparam bake model_uv.glb --from texture --source scan.obj -o model.glb
  circparam bake model_uv.glb --all --source model.glb -o model_new.glb
  circparam bake model.glb --from texture --uv-set 1 --size 1024 -o baked.png
  circparam bake a.obj --from normals --source high.ply --map nearest -o a.glb
  circparam bake a.obj --from texture --source b.glb --map a_to_b.npz -o a.png
"""


@click.command(epilog=_EPILOG)
@click.argument("mesh", type=common.MESH)
@common.value(
    "--from",
    "What to bake; colours means vertex-colors, normals are in tangent space.",
    "kind",
    type=click.Choice(["texture", "vertex-colors", "colours", "normals", "height"]),
)
@common.switch(
    "--all", "Carry all textures of all materials, face to face, into a mesh file.", "whole"
)
@common.path_option(
    "--source",
    "Source of the bake: the mesh before unwrapping, or another mesh.",
    metavar="OTHER",
    type=common.MESH,
)
@common.path_option(
    "--map",
    "How MESH corresponds to OTHER: a file of circparam map (.npz), or nearest (along smooth normals).",
    "by",
    metavar="MAP",
)
@common.value(
    "--cage",
    "Search distance of nearest, outwards and inwards, in mesh units.  [default: 2 % of the diagonal]",
    type=float,
    metavar="D",
)
@common.library_option(
    "size",
    LookOptions,
    help="Side of the image; auto, with --all: as sharp as the old ones.  [default: 2048; auto with --all]",
)
@common.library_option("merge_materials", LookOptions)
@common.library_option("keep_tiled", LookOptions)
@common.library_option("samples", LookOptions)
@common.library_option("check_look", LookOptions)
@common.value(
    "--uv-set", "Uv set of MESH to bake into.", type=click.IntRange(min=0), default=0, metavar="N"
)
@common.library_option("up")
@common.required_output(
    "Image to write (.png), or mesh with images (.glb; with --all any mesh format)."
)
@common.apply(*common.reporting)
def command(mesh: str, **given: Any) -> None:
    """Bake colours, textures, normals or heights into the uv of a mesh.

    If MESH and OTHER have the same triangles, colours go from face to face. Otherwise every texel takes the
    colour of the closest point of OTHER, or of the point that --map gives. Colours extend into the padding.
    Normals follow glTF: MikkTSpace tangents, green up. Heights are 16-bit grey, level in the middle. With
    --all the output is OTHER with the uv of MESH and all its textures and materials.
    """
    look = LookOptions(**common.library_keywords(given, LookOptions))
    whole = given["whole"]
    if whole == (given["kind"] is not None):
        raise OptionError("nothing to bake: give --from WHAT, or --all for every texture")
    if look.size == "auto" and not whole:
        raise OptionError("--size auto has no effect here: it needs --all; give a number")
    why = "--all keeps faces and axes as they are" if whole else "it needs --all"
    useless = ("by", "cage", "up") if whole else [name for name in vars(look) if name != "size"]
    for name in useless:
        if (given if whole else vars(look))[name] is not None:
            flag = "map" if name == "by" else name.replace("_", "-")
            raise OptionError(f"--{flag} has no effect here: {why}; leave it out")
    check_output(given["output"], given["overwrite"])
    with progress.listener(Path(mesh).name, given["quiet"]) as listener:
        report, warnings, notes = (_all if given["whole"] else _one)(mesh, given, look, listener)
    common.print_messages(given, f"{mesh}: ", warnings, notes)
    report = {"schema": "circparam/bake/1", "input": mesh, **report}
    lines = [*report["output"]]
    if check := report.get("check"):
        lines.append(common.tables.look_kept(check))
    common.show(given, report, lambda: "\n".join(lines))


def _one(
    mesh: str, given: dict[str, Any], look: LookOptions, listener: Any
) -> tuple[dict[str, Any], list[str], list[str]]:
    """Bake one thing into one image: (report, warnings, notes)."""
    from circparam.bake.bake import Across, bake_document, check_across
    from circparam.bake.write import check_left_behind, check_target, check_up, write_baked
    from circparam.core.monitor import Monitor
    from circparam.formats.io import read
    from circparam.maps.surface_map import load_map

    path, size = Path(given["output"]), look.fixed_size or IMAGE_TEXELS
    kind = "vertex-colors" if given["kind"] == "colours" else given["kind"]
    uv_set, by, far = (given[name] for name in ("uv_set", "by", "source"))
    check_target(path, kind)
    check_across(kind, far is not None, Across("nearest" if by else None, given["cage"]))
    across = Across(by if by in (None, "nearest") else load_map(by), given["cage"])
    document = read(mesh, reader=given["reader"])
    up = None if given["up"] == "auto" else given["up"]
    check_up(path, document, up)
    other = read(far, reader=given["reader"]) if far is not None else None
    left = check_left_behind(path, document, other, kind, uv_set)
    baked = bake_document(
        document, kind, uv_set=uv_set, source=other, across=across, size=size,
        monitor=Monitor(listener),
    )  # fmt: skip
    files, notes = write_baked(path, baked, document, uv_set, kind, up)
    report = {
        "output": [str(f) for f in files],
        "size": size,
        "covered": baked.covered,
        **baked.report,
        "notes": [*baked.notes, *notes, *left],
    }
    return report, [*document.warnings, *left], [*document.notes, *baked.notes, *notes]


def _all(
    mesh: str, given: dict[str, Any], options: LookOptions, listener: Any
) -> tuple[dict[str, Any], list[str], list[str]]:
    """Write a mesh file with all textures: (report, warnings, notes)."""
    from circparam.bake.rebake import bake_all
    from circparam.core.monitor import Monitor
    from circparam.formats.io import read

    far = given["source"]
    document = read(mesh, reader=given["reader"])
    other = read(far, reader=given["reader"]) if far is not None else None
    written, look = bake_all(
        document, other, given["output"], options, uv_set=given["uv_set"],
        overwrite=given["overwrite"], monitor=Monitor(listener),
    )  # fmt: skip
    notes = [*written.notes, *look.notes]
    report = {"output": [str(f) for f in written.files], **look.as_dict(), "notes": notes}
    return report, [*document.warnings, *written.warnings, *look.notes], []
