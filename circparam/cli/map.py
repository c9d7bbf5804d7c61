"""``circparam map``: one surface onto another, one to one."""

from pathlib import Path
from typing import Any

import click

from circparam.cli import common, progress
from circparam.cli.paths import check_output
from circparam.core.imports import OnDemand

_EPILOG = """\b
Examples:
  circparam map a.obj b.obj --landmarks pairs.txt -o map.npz
  circparam map scan.ply remeshed.ply -o map.npz --json
  circparam map a_uv.obj b_uv.obj --charts -o map.npz
  circparam map left.obj right.obj --mirrored --landmarks pairs.txt -o map.npz
\b
pairs.txt: per line a vertex of A and one of B, from 0; # begins a comment.
A line "path 12 77 503" cuts both meshes first along shortest paths between
these landmarks, given by vertices of A.
"""


weights: Any = OnDemand("circparam.solvers.tutte.weights")


@click.command(epilog=_EPILOG)
@click.argument("a", metavar="A", type=common.MESH)
@click.argument("b", metavar="B", type=common.MESH)
@common.apply(
    common.path_option("--landmarks", "Vertices that correspond: one of A and one of B per line."),
    common.required_output("Map to write (.npz)."),
    common.value(
        "--method",
        "Weights of the convex maps: circle, mean-value, floater or uniform.",
        # the others may fold
        type=common.Name("method", lambda: weights.WEIGHTS.tagged("positive")),
        default="mean-value",
    ),
    common.switch("--charts", "Map chart to chart; the charts of both files correspond."),
    common.switch("--mirrored", "Map to the mirror image of B."),
    common.switch("--no-relax", "Return the composed convex maps without relaxation."),
    common.switch(
        "--overlay", "Add the common refinement of both meshes, for circparam morph --overlay."
    ),
    *common.reporting,
)
def command(a: str, b: str, **given: Any) -> None:
    """Map surface A onto surface B, one to one, landmark to landmark.

    Both must be connected and have the same topology: equal numbers of handles and of boundaries. The map
    gives a place on B for every vertex of A, and a place on A for every vertex of B. It composes convex maps
    onto one domain and relaxes them to low distortion; no face is flipped in that domain.
    """
    from circparam.formats.io import read
    from circparam.maps.map_surfaces import map_surfaces
    from circparam.maps.surface_map import save_map

    out = Path(given["output"])
    check_output(str(out), given["overwrite"], ".npz")
    documents = [read(name, reader=given["reader"]) for name in (a, b)]
    with progress.listener(f"{Path(a).name} to {Path(b).name}", given["quiet"]) as listener:
        words = ("landmarks", "charts", "method", "mirrored", "overlay")
        keywords = {name: given[name] for name in words}
        found = map_surfaces(*documents, relax=not given["no_relax"], listener=listener, **keywords)
    save_map(out, found.map, given["overwrite"])
    for name, document in zip((a, b), documents, strict=True):
        common.print_messages(given, f"{name}: ", document.warnings, document.notes)
    common.print_messages(given, "", (), found.notes)
    report = {"schema": "circparam/map/1", "a": a, "b": b, "output": str(out), **found.as_dict()}
    common.show(given, report, lambda: [common.tables.map_table(report)])
