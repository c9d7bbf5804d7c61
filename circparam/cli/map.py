"""``circparam map``: one surface onto another, one to one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from circparam.cli import common, progress
from circparam.cli.paths import check_place
from circparam.errors import OptionError

_EPILOG = """\b
Examples:
  circparam map a.obj b.obj --landmarks pairs.txt -o map.npz
  circparam map scan.ply remeshed.ply -o map.npz --json
  circparam map a_uv.obj b_uv.obj --charts -o map.npz
  circparam map left.obj right.obj --mirrored --landmarks pairs.txt -o map.npz
\b
pairs.txt: two vertex numbers a line, of A and of B, counted from 0; # begins a comment.
A line "path 12 77 503" cuts both along shortest paths between landmarks, by vertices of A.
"""


def _methods() -> list[str]:
    from circparam.solvers.tutte.weights import WEIGHTS

    return WEIGHTS.tagged("positive")  # the others may fold


@click.command(epilog=_EPILOG)
@click.argument("a", metavar="A", type=common.MESH)
@click.argument("b", metavar="B", type=common.MESH)
@common.apply(
    click.option(
        "--landmarks",
        type=common.FILE,
        metavar="FILE",
        help="Vertices that correspond: a number of A and one of B on each line.",
    ),
    common.required_output("The map (.npz)."),
    click.option(
        "--method",
        type=common.Name("method", _methods),
        default="mean-value",
        show_default=True,
        help="Weights of the convex maps: circle, mean-value, floater or uniform.",
    ),
    click.option(
        "--charts", is_flag=True, help="Both have uv whose charts correspond: map chart on chart."
    ),
    click.option("--mirrored", is_flag=True, help="B is the mirror image of what is meant."),
    click.option(
        "--no-relax", is_flag=True, help="Leave the composition of the convex maps as it is."
    ),
    click.option(
        "--overlay",
        is_flag=True,
        help="Also the common refinement of both meshes, for circparam morph --overlay.",
    ),
    common.library_option("reader"),
    common.overwrite,
    common.json_option,
    common.quiet,
)
def command(a: str, b: str, **given: Any) -> None:
    """Map surface A onto surface B, one to one, landmark on landmark.

    Both must be connected and of the same topology: as many handles, as many boundaries. The map says for
    every vertex of A on which face of B it lies, and back. It is the composition of convex maps onto one
    domain, relaxed to low distortion; no face of either is turned over in that domain.
    """
    from circparam.formats.io import read
    from circparam.maps.surface_map import save_map
    from circparam.maps.surfaces import map_surfaces

    out = Path(given["output"])
    if out.suffix.lower() != ".npz":
        raise OptionError(f"{out}: a map is written as .npz")
    check_place(str(out), given["overwrite"])
    documents = [read(name, reader=given["reader"]) for name in (a, b)]
    with progress.listener(f"{Path(a).name} to {Path(b).name}", given["quiet"]) as listener:
        found = map_surfaces(
            documents[0],
            documents[1],
            landmarks=given["landmarks"],
            charts=given["charts"],
            method=given["method"],
            mirrored=given["mirrored"],
            relax=not given["no_relax"],
            overlay=given["overlay"],
            listener=listener,
        )
    save_map(out, found.map, given["overwrite"])
    for name, document in zip((a, b), documents, strict=True):
        for line in document.warnings:
            progress.warn(f"{name}: {line}", given["quiet"])
        for line in document.notes:
            progress.note(f"{name}: {line}", given["quiet"])
    for line in found.notes:
        progress.note(line, given["quiet"])
    report = {
        "schema": "circparam/map/1",
        "a": a,
        "b": b,
        "output": str(out),
        **found.as_dict(),
    }
    if given["as_json"]:
        common.echo_json(report)
    elif not given["quiet"]:
        from circparam.cli.tables import console, map_table

        console().print(map_table(report))
