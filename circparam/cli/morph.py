"""``circparam morph``: one mesh as a morph target of another, in a GLB that plays."""

from pathlib import Path
from typing import Any

import click

from circparam.cli import common
from circparam.cli.paths import check_output

_EPILOG = """\b
Examples:
  circparam map a.obj b.obj -o map.npz
  circparam morph a.obj b.obj --map map.npz -o morph.glb
  circparam morph a_uv.glb b.glb --map map.npz --frames 30 -o morph.glb
  circparam view morph.glb -o morph.html                a page with a slider
"""


@click.command(epilog=_EPILOG)
@click.argument("first", type=common.MESH, metavar="A")
@click.argument("second", type=common.MESH, metavar="B")
@common.path_option(
    "--map",
    "Map between A and B, in either direction, from circparam map (.npz).",
    "mapped",
    metavar="MAP",
    required=True,
)
@common.required_output("File to write (.glb).")
@common.value(
    "--frames",
    "Key frames from A to B; the animation returns the same way.",
    default=13,
    metavar="N",
)
@common.switch("--overlay", "Morph the common refinement of both meshes; needs map --overlay.")
@common.apply(*common.reporting)
def command(first: str, second: str, **given: Any) -> None:
    """Write A as a GLB with B as a morph target, and an animation from A to B and back.

    Faces, uv, materials and textures are those of A. Its vertices and normals move to their places on B. Any
    glTF viewer plays the animation; circparam view makes a page with a slider.
    """
    from circparam.core.files import write_files
    from circparam.formats.io import read
    from circparam.maps.morph import morph
    from circparam.maps.surface_map import load_map

    path = Path(given["output"])
    check_output(str(path), given["overwrite"], ".glb")
    mapped = load_map(given["mapped"])
    a, b = (read(mesh, reader=given["reader"]) for mesh in (first, second))
    made = morph(a, b, mapped, given["frames"], given["overlay"])
    write_files({path: made.data}, overwrite=True)
    common.print_messages(
        given, f"{first}: ", [*a.warnings, *b.warnings, *made.warnings], made.notes
    )
    report = {"schema": "circparam/morph/1", "input": [first, second], "output": str(path)}
    report |= {**made.report, "notes": [*made.warnings, *made.notes]}
    common.show(given, report, lambda: str(path))
