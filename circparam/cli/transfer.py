"""``circparam transfer``: the layout of one mesh on its other levels of detail."""

import os
from typing import Any

import click

from circparam.cli import common, progress
from circparam.cli.paths import check_outputs, made_folder, output_path
from circparam.errors import OptionError

_EPILOG = """\b
Examples:
  circparam transfer LOD0_uv.glb LOD1.obj LOD2.obj   writes LOD1_uv.obj ...
  circparam transfer hero_uv.obj lods/*.obj --out-dir done
  circparam transfer scan_uv.ply scan_fine.ply -o fine_uv.ply --max-drift 4
"""


@click.command(epilog=_EPILOG)
@click.argument("source", metavar="LOD0", type=common.MESH)
@click.argument("targets", metavar="LOD...", type=common.MESH, nargs=-1, required=True)
@common.apply(
    common.output,
    common.out_dir,
    common.value(
        "--resolution", "Side of the page, for drifts in texels.", default=2048, metavar="TEXELS"
    ),
    common.value(
        "--max-drift",
        "Exit 5 and write nothing if a corner drifts further; 8 is the gutter between charts.",
        default=8.0,
        metavar="TEXELS",
    ),
    common.overwrite,
    common.library_option("uv_set"),
    common.library_option("ply_uv"),
    common.library_option("copy_assets"),
    common.library_option("reader"),
    common.json_option,
    common.quiet,
)
def command(source: str, targets: tuple[str, ...], **given: Any) -> None:
    """Give coarser or finer meshes the layout of the first: one texture for all levels of detail.

    Seams follow those of the first mesh, no face flips, and the largest drift of a corner is reported in
    texels. All meshes have the same shape and place; their vertices and faces need not correspond.
    """
    from circparam.maps.lods import transfer

    given["format"] = None
    outputs = [output_path(target, given) for target in targets]
    check_outputs(targets, outputs, given)
    if any(os.path.realpath(out) == os.path.realpath(source) for out in outputs if out != "-"):
        raise OptionError(
            f"{source}: the output would replace the mesh with the layout: name another"
        )
    keywords = common.library_keywords(given)
    with (
        made_folder(given["out_dir"]),
        progress.listener(f"{source} to {len(targets)}", given["quiet"]) as listener,
    ):
        keywords |= {name: given[name] for name in ("resolution", "max_drift")}
        done = transfer(source, targets, outputs, listener=listener, **keywords)
    rows = [{"input": name, **one.as_dict()} for name, one in zip(targets, done, strict=True)]
    for row in rows:
        common.print_messages(given, f"{row['input']}: ", row["warnings"])
    report = {"schema": "circparam/transfer/1", "source": source, "targets": rows}
    report |= {name: given[name] for name in ("resolution", "max_drift")}
    common.show(given, report, lambda: [_table(rows)])


def _table(rows: list[dict[str, Any]]) -> Any:
    """The figures of each mesh; drifts in texels."""
    cells = {}
    for row in rows:
        whole = [str(row[name]) for name in ("faces", "charts", "flips", "overlap")]
        cells[str(row["output"])] = [*whole, f"{row['drift']:.2f}", f"{row['inside_p95']:.2f}"]
    heads = ("faces", "charts", "flips", "overlaps", "drift", "inside 95 %")
    return common.tables.columns("output", heads, cells)
