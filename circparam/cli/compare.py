"""``circparam compare``: several methods on the identical cut, side by side."""

import csv
import io
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from circparam.cli import common, exits, progress
from circparam.cli.paths import check_output
from circparam.errors import CircparamError, NoResultError, OptionError

if TYPE_CHECKING:
    from circparam.compare.kim2019 import Size
    from circparam.compare.rows import Comparison


SCHEMA = "circparam/compare/1"
_EPILOG = """\b
Examples:
  circparam compare --methods circle,floater
  circparam compare mesh.obj --methods circle,mean-value,lscm,isometric
  circparam compare mesh.obj --methods isometric,xatlas --json
  circparam compare *.obj --methods all --csv figures.csv -q
  circparam compare mesh.obj --methods circle,isometric --report report.html
"""
# options of every method
_LIBRARY = ("max_distortion", "boundary", "spacing", "timeout", "jobs", "reader")


@click.command(cls=common.Command, epilog=_EPILOG)
@click.argument("meshes", nargs=-1, type=common.MESH)
@common.value(
    "--methods",
    "Names separated by commas, or all; also xatlas, xatlas-default, uvunwrap (if installed).",
    "-m",
    default="circle,floater",
    metavar="NAMES",
)
@common.value(
    "--cut", "auto (charts, except for disks), charts, disk or none.", default="auto", metavar="CUT"
)
@common.library_option("max_distortion", help="Upper bound on distortion, with --cut charts.")
@common.library_option(
    "boundary", metavar="TEXT", help="Boundary of the convex methods.  [default: circle]"
)
@common.library_option("spacing", help="Spacing along that boundary: arc-length or uniform.")
@common.library_option("timeout", help="Time limit for each method.")
@common.library_option(
    "jobs", help="Processes for the cut; methods run one by one.  [default: cores]"
)
@common.library_option("reader")
@click.option(
    "--repeats", type=click.IntRange(1, 1000), help="Runs for each size of Table 1.  [default: 31]"
)
@common.path_option("--report", "Write a page: pictures, tables, plots.", metavar="FILE.html")
@common.path_option("--plot", "Write the layouts side by side.", metavar="FILE.png")
@common.json_option
@common.path_option("--csv", "Write the rows as CSV.", "csv_file")
@common.overwrite
@common.quiet
def command(meshes: tuple[str, ...], **given: Any) -> int:
    """Compare several methods on the identical cut.

    Each method runs in a process of its own, so that its peak memory is its own. An existing uv set appears as
    the row "input". Without MESH the bundled samples are compared, and circle and floater are timed on the
    sizes of Table 1 of Kim (2019).
    """
    from circparam import samples
    from circparam.compare import kim2019
    from circparam.compare.compare import compare, method_names

    names = method_names(given["methods"])
    table1 = not meshes and {kim2019.TIMED_METHOD, kim2019.TIMED_PEER} <= set(names)
    if given["repeats"] is not None and not table1:
        raise OptionError(
            "--repeats has no effect here: it is for Table 1, which compares "
            f"{kim2019.TIMED_METHOD} and {kim2019.TIMED_PEER} without MESH; leave it out"
        )
    repeats = given["repeats"] or kim2019.RUNS
    # refused before hours of work, not after
    for option, *ending in (("csv_file",), ("report", ".html"), ("plot", ".png")):
        if given[option] is not None:
            check_output(given[option], given["overwrite"], *ending)
    silent = given["as_json"] or given["quiet"]
    keywords = {k: given[k] for k in _LIBRARY if given[k] is not None}
    compared, found, codes = meshes or tuple(samples.names(pairs=False)), [], []
    for k, mesh in enumerate(compared, 1):
        source, place = mesh if meshes else samples.path(mesh), (k, len(compared))
        try:
            with progress.listener(os.path.basename(mesh), given["quiet"], place) as listener:
                result = compare(source, names, cut=given["cut"], listener=listener, **keywords)
        except OptionError:
            raise
        except CircparamError as error:
            if len(meshes) == 1:
                raise type(error)(exits.line_about(str(source), error)) from None
            codes.append(common.complain(str(source), error))
            continue
        found.append(result)
        if not silent:
            common.tables.print_comparison(result, None if meshes else mesh)
    sizes = kim2019.timed_sizes(repeats=repeats) if table1 else None
    if sizes is not None and not silent:
        common.tables.print_table1(sizes, repeats)
    _write(found, sizes, {**given, "repeats": repeats})
    rows = [row for c in found for row in c.rows if row.method != "input"]
    if rows and all(row.status == "failed" for row in rows):
        raise NoResultError(f"no method produced a result; {rows[0].method}: {rows[0].error}")
    return next(iter(codes), exits.OK)


def _write(found: "list[Comparison]", sizes: "list[Size] | None", given: dict[str, Any]) -> None:
    """JSON, CSV, the page and the image, as asked for."""
    from circparam import __version__
    from circparam.compare import kim2019
    from circparam.core.files import write_files

    if given["as_json"]:
        document: dict[str, Any] = {"schema": SCHEMA, "version": __version__}
        document |= {"meshes": [c.as_dict() for c in found], "table1": None}
        if sizes is not None:
            rows = [s.as_dict() for s in sizes]
            ratios = {"repeats": given["repeats"], "range_of_source": kim2019.PRINTED_RATIOS}
            document["table1"] = {**ratios, "sizes": rows}
        common.echo_json(document, 2)

    contents: dict[Path, bytes] = {}
    if given["csv_file"] is not None:
        contents[Path(given["csv_file"])] = _csv(found).encode("utf-8", "surrogateescape")
    if given["report"] is not None or given["plot"] is not None:
        from circparam.formats.materials import encoded_image
        from circparam.render.compare_page import compare_page, compare_plot

        if given["report"] is not None:
            contents[Path(given["report"])] = compare_page(found, sizes or ()).encode()
        if given["plot"] is not None:
            plot = compare_plot(found)
            contents[Path(given["plot"])] = encoded_image(plot, optimize=True)
    if contents:  # all or none
        write_files(contents, overwrite=True)


def _csv(found: "list[Comparison]") -> str:
    """One line a mesh and method; stages as columns, seconds."""
    rows = []
    for c in found:
        for entry in c.rows:
            row = {"mesh": c.mesh, "cut": c.cut, "cut_seconds": c.cut_seconds, **entry.as_dict()}
            stages = row.pop("stages")
            row["notes"] = "; ".join(row["notes"])
            rows.append({**row, **{f"seconds_{k}": v for k, v in stages.items()}})
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, names, restval="")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
