"""``circparam view``: the layout, the surface with a checker, and the distortion, in one file."""

from pathlib import Path
from typing import Any

import click

from circparam.cli import common, progress
from circparam.cli.paths import beside, check_output
from circparam.errors import OptionError

_EPILOG = """\b
Examples:
  circparam view mesh_uv.obj                         writes mesh_uv_view.png
  circparam view mesh_uv.glb -o page.html            an interactive page
  circparam view mesh_uv.obj --before mesh.obj -o both.html
  circparam view mesh_uv.obj -o layout.svg           for a drawing program
  circparam view model.glb --uv-set 1 -o lightmap.png
"""


@click.command(epilog=_EPILOG)
@click.argument("mesh", type=common.MESH)
@common.path_option(
    "--output", "File to write: .png, .svg or .html.  [default: MESH_view.png]", "-o"
)
@common.value(
    "--uv-set", "Number of the uv set, from 0.", type=click.IntRange(min=0), default=0, metavar="N"
)
@common.path_option(
    "--before",
    "Show the layout of this mesh beside MESH, on a page (.html).",
    metavar="OLD",
    type=common.MESH,
)
@common.value(
    "--padding",
    "Draw a band of this width, in uv units, around every chart.",
    type=common.FiniteRange(0, 1),
    default=0.0,
    metavar="UV",
    show_default=False,
)
@common.value(
    "--scale",
    "End of the colour scale of distortion.  [default: 2]",
    type=common.FiniteRange(1, min_open=True),
    metavar="D",
)
@common.value(
    "--up", "Up axis of the mesh.", type=click.Choice(["auto", "x", "y", "z"]), default="auto"
)
@common.atlas_groups
@common.format_option
@common.library_option("reader")
@common.overwrite
@common.quiet
def command(mesh: str, **given: Any) -> None:
    """Draw the uv of a mesh: the layout, a checker on the surface, and the distortion.

    Works for any mesh with uv from any program. A page (.html) is one file that needs no network: turn and
    zoom the surface, point at a chart to find it in both views, show the texture of the mesh. With --before
    the layouts of two files stand side by side and turn together.
    """
    from circparam.core.monitor import Monitor
    from circparam.formats.io import read
    from circparam.render.show import check_before, check_kind, view_document

    if given["output"] is None and mesh == "-":
        raise OptionError("the mesh comes from standard input: name the picture with -o FILE")
    path = Path(given["output"] or beside(Path(mesh), "_view", ".png"))
    check_kind(path)
    if given["before"] is not None:
        check_before(path)
        if mesh == given["before"] == "-":
            raise OptionError("MESH and --before are both standard input: name one of the files")
    check_output(str(path), given["overwrite"])
    look = {name: given[name] for name in ("uv_set", "padding", "up", "group_by")}
    with progress.listener(Path(mesh).name, given["quiet"]) as listener:
        monitor = Monitor(listener)
        with monitor.stage("read"):
            document = read(mesh, format=given["format"], reader=given["reader"])
            before = given["before"] and read(given["before"], reader=given["reader"])
        with monitor.stage("draw"):
            view_document(document, path, **look, scale_end=given["scale"], before=before)
    common.print_messages(given, f"{mesh}: ", document.warnings, document.notes)
    if not given["quiet"]:
        click.echo(str(path))
