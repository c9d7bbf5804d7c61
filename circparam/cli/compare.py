"""``circparam compare``: several methods on the identical cut, side by side."""

from __future__ import annotations

import csv
import json
import os
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from circparam.cli import exits, options, progress
from circparam.errors import CircparamError, NoResultError, OptionError, OutputError

if TYPE_CHECKING:
    from circparam.compare.compare import Comparison
    from circparam.compare.kim2019 import Size


SCHEMA = "circparam/compare/1"
_EPILOG = """\b
Examples:
  circparam compare --methods circle,floater
  circparam compare mesh.obj --methods circle,mean-value,lscm,isometric
  circparam compare mesh.obj --methods isometric,xatlas --json
  circparam compare *.obj --methods all --csv figures.csv -q
  circparam compare mesh.obj --methods circle,floater,isometric --report report.html
"""


@click.command(cls=options.Command, epilog=_EPILOG)
@click.argument("meshes", nargs=-1, type=options.MESH)
@click.option(
    "--methods",
    "-m",
    default="circle,floater",
    show_default=True,
    metavar="NAMES",
    help="Names separated by commas; all; xatlas or xatlas-default where that is installed.",
)
@click.option(
    "--cut",
    default="auto",
    show_default=True,
    metavar="CUT",
    help="auto (disks stay whole, others get charts), charts, disk or none.",
)
@click.option("--max-distortion", type=float, metavar="D", help="Bound of --cut charts.")
@click.option("--boundary", help="Boundary of the convex methods.  [default: circle]")
@click.option("--spacing", help="Spacing along that boundary: arc-length or uniform.")
@click.option("--timeout", type=float, metavar="SECONDS", help="Bound for each method.")
@click.option(
    "--repeats",
    type=click.IntRange(1, 1000),
    default=31,
    show_default=True,
    help="Of each size of Table 1.",
)
@click.option(
    "--report",
    type=options.FILE,
    metavar="FILE.html",
    help="Write a page: pictures, tables, plots.",
)
@click.option(
    "--plot", type=options.FILE, metavar="FILE.png", help="Write the layouts side by side."
)
@options.json_option
@click.option("--csv", "csv_file", type=options.FILE, metavar="FILE", help="Write the rows as CSV.")
@options.overwrite
@options.quiet
def command(
    meshes: tuple[str, ...],
    methods: str,
    cut: str,
    repeats: int,
    as_json: bool,
    csv_file: str | None,
    report: str | None,
    plot: str | None,
    overwrite: bool,
    quiet: bool,
    **keywords: Any,
) -> int:
    """Run several methods on the identical cut and put them side by side.

    Each method runs in a process of its own, so that its peak memory is its own. A uv set that the file has
    already is the row "input". Without MESH the bundled samples are compared, and circle and floater are
    timed on the sizes of Table 1 of the source.
    """
    from circparam import samples
    from circparam.compare import kim2019
    from circparam.compare.compare import compare, method_names

    names = method_names(methods)
    for path, ending in ((csv_file, ""), (report, ".html"), (plot, ".png")):
        if path is not None:
            _check_output(path, overwrite, ending)
    given = {k: v for k, v in keywords.items() if v is not None}
    silent = as_json or (quiet and csv_file is not None)
    found, codes = [], [exits.OK]
    for mesh in meshes or samples.names():
        source = mesh if meshes else samples.path(mesh)
        try:
            with progress.listener(os.path.basename(mesh), quiet) as listener:
                found.append(compare(source, names, cut=cut, listener=listener, **given))
        except CircparamError as error:
            if isinstance(error, OptionError) or len(meshes) == 1:
                raise
            click.echo(f"circparam: error: {exits.line_of(error)}", err=True)
            codes.append(exits.code_of(error))
            continue
        if not silent:
            click.echo(_table(found[-1], None if meshes else mesh) + "\n")
    sizes = None
    if (not meshes or report is not None) and {kim2019.METHOD, kim2019.PEER} <= set(names):
        sizes = kim2019.measure(repeats=repeats)
        if not silent:
            click.echo(_table1(sizes, repeats))
    if as_json:
        document = _document(found, sizes, repeats)
        click.echo(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))
    if csv_file is not None:
        _write_csv(csv_file, found)
    if report is not None or plot is not None:
        _write_pictures(found, report, plot, sizes)
    _fail_if_nothing(found)
    return next((code for code in codes if code), exits.OK)


def _write_pictures(
    found: list[Comparison], report: str | None, plot: str | None, sizes: list[Size] | None
) -> None:
    """The page and the image of what was compared."""
    from circparam.formats.io import read
    from circparam.render.compare_page import save_plot, save_report
    from circparam.render.side_by_side import side_by_side

    meshes = [side_by_side(c, read(c.mesh).mesh, os.path.basename(c.mesh)) for c in found]
    if report is not None:
        save_report(report, meshes, sizes or ())
    if plot is not None:
        save_plot(plot, meshes)


def _check_output(path: str, overwrite: bool, ending: str = "") -> None:
    """Refuse before hours of work, not after."""
    if not path.lower().endswith(ending):
        raise OptionError(f"{path}: end the name in {ending}")
    if Path(path).exists() and not overwrite:
        raise OptionError(f"{path} exists already: give --overwrite or another name")
    if not Path(path).absolute().parent.is_dir():
        raise OutputError(f"{path}: there is no folder {Path(path).absolute().parent}")


def _fail_if_nothing(found: list[Comparison]) -> None:
    rows = [row for c in found for row in c.rows if row.method != "input"]
    if rows and all(row.status == "failed" for row in rows):
        raise NoResultError(f"no method had a result; {rows[0].method}: {rows[0].error}")


# text ----------------------------------------------------------------------------------------------
_COST = [
    *[("charts", 6), ("seam", 7), ("weights", 9), ("solve", 9), ("total", 9), ("peak MB", 9)],
    *[("flips", 7), ("overlap", 9)],
]
_QUALITY = [
    ("SD/4", 10),
    ("worst", 10),
    ("L2", 9),
    ("Linf", 10),
    ("angle", 9),
    ("area", 9),
    ("pack", 7),
]


def _table(c: Comparison, name: str | None) -> str:
    """What it costs and what it is worth, two tables of at most 80 columns."""
    facts = f"{c.vertices} vertices, {c.faces} faces; cut {c.cut}, {c.cut_seconds:.2f} s"
    one = f"{name or c.mesh}: {facts}"
    lines = [one] if len(one) <= 80 else [name or c.mesh, facts]
    lines.append(_line("method", [label for label, _ in _COST], _COST))
    for row in c.rows:
        if row.status == "failed":
            lines.append(f"{row.method:14} failed")
            continue
        f = row.figures
        seconds = [row.stages.get("weights"), row.stages.get("solve"), row.seconds]
        cells = [
            _count(f["charts"]),
            _number(f["seam_length"], 2),
            *(_number(s, 4) for s in seconds),
        ]
        peak = None if row.peak_bytes is None else row.peak_bytes / 2**20
        cells += [_number(peak, 1), _count(f["flips"]), _count(f["overlap"])]
        lines.append(_line(row.method, cells, _COST))
    lines.append(_line("method", [label for label, _ in _QUALITY], _QUALITY))
    for row in c.rows:
        if row.status != "failed":
            f = row.figures
            keys = (
                "distortion",
                "distortion_max_chart",
                "stretch_l2",
                "stretch_linf",
                "angle",
                "area",
            )
            cells = [*(_number(f[key], 4) for key in keys), _number(f["pack"], 3)]
            lines.append(_line(row.method, cells, _QUALITY))
    for row in c.rows:
        for text in filter(None, [row.error, *row.notes]):
            note = text if text.startswith(f"{row.method}:") else f"{row.method}: {text}"
            lines += textwrap.wrap(note, 80, initial_indent="  ", subsequent_indent="    ")
    return "\n".join(lines)


def _table1(sizes: list[Size], repeats: int) -> str:
    """Table 1 of the source beside what was measured here."""
    from circparam.compare.kim2019 import RANGE

    lines = [f"Table 1 of the source (Kim 2019), median of {repeats} repeats, ms [quartiles]"]
    lines.append(
        f"{'vertices':>8}{'circle':>22}{'Floater':>22}{'ratio':>9}{'paper':>8}{'weights':>10}"
    )
    for s in sizes:
        spreads = [
            f"{1e3 * x.median:.2f} [{1e3 * x.low:.2f} {1e3 * x.high:.2f}]"
            for x in (s.circle, s.floater)
        ]
        paper = "-" if s.paper_ratio is None else f"{s.paper_ratio:.3f}"
        lines.append(
            f"{s.vertices:>8}{spreads[0]:>22}{spreads[1]:>22}{s.ratio:>9.3f}{paper:>8}{s.weights_ratio:>10.2f}"
        )
    outside = [s.vertices for s in sizes if not RANGE[0] <= s.ratio <= RANGE[1]]
    lines.append(
        f"ratio = Floater / circle; the source has {RANGE[0]} to {RANGE[1]}, its text 20 to 30 %."
    )
    lines.append("weights = the same ratio for the weight stage alone.")
    if outside:
        lines.append(f"Outside that range here: {', '.join(map(str, outside))} vertices.")
    return "\n".join(lines)


def _line(first: str, cells: list[str], columns: list[tuple[str, int]]) -> str:
    widths = (width for _, width in columns)
    return f"{first:14}" + "".join(f"{c:>{w}}" for c, w in zip(cells, widths, strict=True))


def _count(value: float | int | None) -> str:
    return "-" if value is None else str(int(value))


def _number(value: float | int | None, digits: int) -> str:
    """A number that stays within its column."""
    if value is None or value != value:
        return "-"
    return f"{value:.{digits}f}" if abs(value) < 1000 else f"{value:.3g}"


# files ---------------------------------------------------------------------------------------------
def _document(found: list[Comparison], sizes: list[Size] | None, repeats: int) -> dict[str, Any]:
    from circparam import __version__
    from circparam.compare import kim2019

    printed = None
    if sizes is not None:
        rows = [s.as_dict() for s in sizes]
        printed = {"repeats": repeats, "range_of_source": kim2019.RANGE, "sizes": rows}
    meshes = [c.as_dict() for c in found]
    return {"schema": SCHEMA, "version": __version__, "meshes": meshes, "table1": printed}


def _write_csv(path: str, found: list[Comparison]) -> None:
    """One line a mesh and method; stages as columns, seconds."""
    rows = []
    for c in found:
        for entry in c.rows:
            row = {"mesh": c.mesh, "cut": c.cut, "cut_seconds": c.cut_seconds, **entry.as_dict()}
            stages = row.pop("stages")
            row["notes"] = "; ".join(row["notes"])
            rows.append({**row, **{f"seconds_{k}": v for k, v in stages.items()}})
    names = list(dict.fromkeys(name for row in rows for name in row))
    try:
        with Path(path).open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, names, restval="")
            writer.writeheader()
            writer.writerows(rows)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
