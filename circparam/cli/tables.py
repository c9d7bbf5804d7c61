"""Reports as text for a terminal: within 80 columns, colours only where the terminal has them.

All tables have one style: facts (a bold name, then its value) or columns (a bold name, then numbers to the
right). None has lines.
"""

import os
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from circparam.core.plural import counted, plural

if TYPE_CHECKING:
    from circparam.compare.kim2019 import Size
    from circparam.compare.rows import Comparison, Entry

_STATUS = {"ok": "green", "repaired": "yellow", "degraded": "red", "failed": "red"}


class _Console(Console):
    """A console that leaves a closed pipe to the command line, which has a code and a line for it."""

    def on_broken_pipe(self) -> None:
        """Called while the error is handled: let it go on."""
        raise


def console(**keywords: Any) -> Console:
    """A console for stdout; honours NO_COLOR, and 80 columns where the output is no terminal."""
    out = _Console(highlight=False, soft_wrap=False, **keywords)
    if not out.is_terminal:
        out = _Console(highlight=False, width=80, **keywords)
    return out


def facts(rows: Iterable[tuple[str, object]]) -> Table:
    """Names and values, one pair a line; the values are plain text, or Text with a style."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(escape(name), value if isinstance(value, Text) else escape(str(value)))
    return table


def columns(first: str, heads: Iterable[str], rows: Mapping[str, Iterable[str]]) -> Table:
    """A name and its numbers, one line each, under a line of heads."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False, header_style="bold")
    table.add_column(first, style="bold", no_wrap=True)
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    for name, cells in rows.items():
        table.add_row(escape(name), *map(escape, cells))
    return table


def unwrap_table(report: dict[str, Any], verbose: int = 0) -> Table:
    """A short table of one unwrap; ``verbose`` adds the stages, and the notes from 2 on."""
    status, worst = report["status"], _number(report["distortion_max_chart"])
    rows: list[tuple[str, object]] = [
        ("status", Text(status, _STATUS.get(status, "white"))),
        ("input", report["input"]),
        ("output", report["output"] or "(in memory)"),
        ("method", f"{report['method']}, cut {report['cut']}"),
    ]
    effort = report.get("effort", {})
    if effort.get("searches", 1) > 1:
        left = f"; no time for {effort['more']} more" if effort["more"] else ""
        best = f"number {effort['best'] + 1} costs least"
        rows.append(("searches", f"{effort['searches']} made, {best}{left}"))
    rows += [
        ("charts", f"{report['charts']} of {counted(report['faces'], 'face')}{_thin(report)}"),
        ("flips, overlaps", f"{report['flips']}, {report['overlap']}"),
        ("distortion", f"{_number(report['distortion'])} (worst chart {worst}; 1 is perfect)"),
        ("stretch", _tail(report)),
        ("seam length", _seams(report)),
    ]
    if report["pack"] is not None:
        pages = "the page" if report["pages"] == 1 else f"{report['pages']} pages"
        rows.append(("packed", f"{_percent(report['pack'])} of {pages}"))
    rows += _densities(report)
    for group in report.get("groups") or ():
        pages = f"{plural(len(group['pages']), 'page')} {', '.join(map(str, group['pages']))}"
        u0, v0, u1, v1 = group["box"]
        place = f"{pages}, u {u0:.3f} to {u1:.3f}, v {v0:.3f} to {v1:.3f}"
        charts = counted(group["charts"], "chart")
        rows.append((f"  {group['name']}", f"{charts} on {place}"))
    if look := report.get("look"):
        images = f"{len(look['images'])} of {look['size']} texels: {', '.join(look['images'])}"
        rows.append(("images", images))
        for name in ("materials", "draw_calls"):
            if look[name] is not None:
                rows.append(
                    (name.replace("_", " "), f"{look[name + '_before']} before, {look[name]} now")
                )
        if check := look.get("check"):
            rows.append(("look kept", look_kept(check)))
    rows.append(("time", f"{report['seconds']:.2f} s"))
    rows += [("repaired", line) for line in report["repairs"]]
    if verbose:
        rows += [(f"  {name}", f"{seconds:.3f} s") for name, seconds in report["stages"].items()]
    if verbose > 1:
        rows += [("note", line) for line in report["notes"]]
    return facts(rows)


def look_kept(check: dict[str, Any]) -> str:
    """The figures of --check-look in one line."""
    return f"PSNR {check['psnr']}, SSIM {check['ssim']} (worst channel or file)"


def summary_table(reports: list[dict[str, Any]]) -> Table:
    """Results of several meshes: one line each, and the number of each status."""
    rows: dict[str, Iterable[str]] = {}
    for number, report in enumerate(reports, 1):
        figures = ["-"] * 5
        if report["status"] != "failed":
            figures = [
                str(report["charts"]), _number(report["distortion"]), f"{report['seam_length']:.2f}",
                _percent(report["pack"]), f"{report['seconds']:.2f}",
            ]  # fmt: skip
        rows[f"{number} {_short(report['input'])}"] = [report["status"], *figures]
    counts = Counter(report["status"] for report in reports)
    said = ", ".join(f"{counts[name]} {name}" for name in _STATUS if counts[name])
    heads = ("status", "charts", "distortion", "seam", "packed", "seconds")
    table = columns("mesh", heads, rows)
    table.caption = f"{len(reports)} meshes: {said}"
    table.caption_justify, table.caption_style = "left", ""
    return table


def atlas_table(report: dict[str, Any]) -> Table:
    """The files that share an atlas, one line each."""
    rows = {
        f"{number} {_short(part['input'])}": [
            f"{part['faces']:,}", str(part["charts"]), _percent(part["packed"]),
        ]
        for number, part in enumerate(report["parts"], 1)
    }  # fmt: skip
    return columns("mesh", ("faces", "charts", "packed"), rows)


def _short(path: str) -> str:
    """The name of a file without its folder, at most 26 characters; a long name loses its middle."""
    name = os.path.basename(path) or path
    return name if len(name) <= 26 else f"{name[:13]}…{name[-12:]}"


LISTED_COMPONENTS = 12  # components that a table shows


def check_table(report: dict[str, Any]) -> Table:
    """Topology of a mesh and quality of its uv."""
    unused, parts, sets = (
        report[name] for name in ("unreferenced_vertices", "component_list", "uv_sets")
    )
    more = f" and {unused} that no face uses" if unused else ""
    rows: list[tuple[str, object]] = [
        ("input", f"{report['input']} ({report['format'].upper()})"),
        ("vertices", f"{report['vertices']}{more}"),
        ("edges, faces", f"{report['edges']}, {report['faces']}"),
        ("Euler, genus", f"{report['euler']}, {report['genus'] if report['genus'] is not None else '-'}"),
        ("boundaries", report["boundaries"]),
    ]  # fmt: skip
    rows += [(plural(2, label), report[name]) for name, label in _DEFECTS.items() if report[name]]
    for number, part in enumerate(parts[:LISTED_COMPONENTS]):
        lengths = [f"{x:.4g}" for x in part["boundary_lengths"][:4]]
        lengths += ["..."] if len(part["boundary_lengths"]) > 4 else []
        boundaries = f"; boundaries of length {', '.join(lengths)}" if lengths else ""
        said = f"{part['verdict']}, {counted(part['faces'], 'face')}{boundaries}"
        rows.append((f"component {number}", said))
    if len(parts) > LISTED_COMPONENTS:
        rows.append(("", f"and {len(parts) - LISTED_COMPONENTS} components more"))
    # with their numbers, so that number 0 is not taken for none
    rows.append(("uv sets", f"{len(sets)} ({_numbers_of(sets)})" if sets else "none"))
    if (uv := report["uv"]) is not None:
        worst = _number(uv["distortion_max_chart"])
        rows += [
            ("charts", f"{uv['charts']}{_thin(uv)}"),
            ("flips, overlaps, mirrored", f"{uv['flips']}, {uv['overlap']}, {uv['mirrored']}"),
            ("distortion", f"{_number(uv['distortion'])} (worst chart {worst})"),
            ("stretch L2, L-infinity", f"{_number(uv['stretch_l2'])}, {_number(uv['stretch_linf'])}"),
            ("stretch", _tail(uv)),
            ("angle, area", f"{_number(uv['angle'])}, {_number(uv['area'])}"),
            ("seam length", _seams(uv)),
        ]  # fmt: skip
        rows += [] if uv["pack"] is None else [("packed", _percent(uv["pack"]))]
        rows += [*_densities(uv), *(("fault", line) for line in uv["faults"])]
    return facts(rows)


_DEFECTS = {
    "nonmanifold_edges": "non-manifold edge",
    "nonmanifold_vertices": "non-manifold vertex",
    "inconsistent_edges": "winding conflict",
    "degenerate_faces": "degenerate face",
    "duplicate_faces": "duplicate face",
}


def _numbers_of(numbers: list[int]) -> str:
    """``number 0``, ``numbers 0, 2``."""
    return f"{plural(len(numbers), 'number')} {', '.join(map(str, numbers))}"


def map_table(report: dict[str, Any]) -> Table:
    """Quality of a map between two surfaces."""
    marks, turned = report["landmarks"], report["inversions"]
    off = f", off by {report['landmark_error']:.2g} of the size" if marks else " given"
    rows = [
        ("surfaces", f"{report['a']} to {report['b']}"),
        ("output", report["output"]),
        ("landmarks", f"{marks}{off}"),
        ("inversions", f"{turned['a']} of A, {turned['b']} of B"),
    ]
    for name, label in (("a_to_b", "A to B"), ("b_to_a", "B to A")):
        mean, p95, p99, most = (
            _number(report["distortion"][name][k]) for k in ("mean", "p95", "p99", "max")
        )
        tail = f"95 % of the area below {p95}, 99 % {p99}, at most {most}; 1 is perfect"
        rows.append((f"distortion, {label}", f"{mean} ({tail})"))
    return facts([*rows, ("time", f"{report['seconds']:.2f} s")])


def check_line(report: dict[str, Any]) -> str:
    """Topology of a mesh and quality of its uv, in one line."""
    parts = report["component_list"]
    verdict = parts[0]["verdict"] if len(parts) == 1 else counted(len(parts), "component")
    words = [counted(report["faces"], "face"), verdict, counted(report["boundaries"], "boundary")]
    words += [counted(report[name], label) for name, label in _DEFECTS.items() if report[name]]
    uv = report["uv"]
    if uv is not None:
        words += [counted(uv[f"{noun}s"], noun) for noun in ("chart", "flip")]
        words.append(counted(uv["overlap"], "overlap"))
        words.append(f"distortion {_number(uv['distortion'])}, seam {_number(uv['seam_length'])}")
    elif report["uv_sets"]:
        count = len(report["uv_sets"])
        words.append(f"{counted(count, 'uv set')} ({_numbers_of(report['uv_sets'])})")
    return ", ".join(words)


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _seams(report: dict[str, Any]) -> str:
    length = f"{_number(report['seam_length'])} x sqrt(area)"
    seen, added = report.get("seam_visible"), report.get("seam_vertices")
    if seen is not None:
        length += f", {100 * seen:.0f} % of it seen from a direction"
    return length if added is None else f"{length}, {counted(added, 'vertex')} more"


def _thin(report: dict[str, Any]) -> str:
    thin = report.get("thin")
    return f", {thin} thinner than 8 texels" if thin else ""


def _densities(report: dict[str, Any]) -> Iterable[tuple[str, str]]:
    """Texels per unit of the charts with the fewest and the most, and of the parts of --density."""
    least, most = report.get("density_min"), report.get("density_max")
    if least is not None and most is not None:
        yield "texels a unit", f"{least:.4g} to {most:.4g}"
    for part in report.get("density") or ():
        asked = f"density {part['got']:.3f}, {part['asked']:.3f} asked"
        yield f"  {part['name']}", f"{part['texels']:.4g}: {asked}"


def _tail(report: dict[str, Any]) -> str:
    """How far most of the surface is stretched or shrunk, at most."""
    names = (("stretch_p95", "95"), ("stretch_p99", "99"), ("stretch_p999", "99.9"))
    values = ((report[name], percent) for name, percent in names)  # None where it is infinite
    shares = (
        f"{'infinite' if x is None or x > 1e50 else f'{x:.3g}'} on {percent} %"
        for x, percent in values
    )
    return f"at most {', '.join(shares)}"


def _number(value: float | None) -> str:
    if value is None or value > 1e50:
        return "-" if value is None else "infinite"
    return f"{value:.4f}" if value < 1e4 else f"{value:.3g}"


def _fixed(value: float | int | None, digits: int | None) -> str:
    """A number that stays within its column; without digits a count."""
    if value is None or value != value:
        return "-"
    if digits is None:
        return str(int(value))
    return f"{value:.{digits}f}" if abs(value) < 1000 else f"{value:.3g}"


# a comparison: cost and quality of each row, and Table 1 of the source --------------------------------------
Figures = dict[str, tuple[str, int | None]]
# head of a column → name of the figure, and its digits (None: a count)
_COST_FIGURES: Figures = {"charts": ("charts", None), "seam length": ("seam_length", 2)}
_FAULTS: Figures = {"flips": ("flips", None), "overlap": ("overlap", None)}
_QUALITY: Figures = {
    "distortion": ("distortion", 4),
    "worst chart": ("distortion_max_chart", 4),
    "L2": ("stretch_l2", 4),
    "Linf": ("stretch_linf", 4),
    "angle": ("angle", 4),
    "area": ("area", 4),
    "packed": ("pack", 3),
}
_SECONDS = ("weights", "solve", "total")


def print_comparison(found: "Comparison", shown: str | None) -> None:
    """Cost and quality of each row, two tables of at most 80 columns, and the notes.

    shown: a name for the mesh in place of that of its file.
    """
    title = shown or found.mesh
    sizes = f"{counted(found.vertices, 'vertex')}, {counted(found.faces, 'face')}"
    about = f"{sizes}; cut {found.cut}, {found.cut_seconds:.2f} s"
    one = f"{title}: {about}"
    click.echo(one if len(one) <= 80 else f"{title}\n{about}")
    heads = [*_COST_FIGURES, *_SECONDS, "peak MB", *_FAULTS]
    out = console()
    out.print(columns("method", heads, {row.method: _cost(row) for row in found.rows}))
    good = {row.method: _figures(row, _QUALITY) for row in found.rows if row.status != "failed"}
    out.print(columns("method", _QUALITY, good))
    for row in found.rows:
        for text in filter(None, [row.error, *row.notes]):
            note = text if text.startswith(f"{row.method}:") else f"{row.method}: {text}"
            click.echo(textwrap.fill(note, 80, initial_indent="  ", subsequent_indent="    "))
    click.echo()


def _cost(row: "Entry") -> list[str]:
    if row.status == "failed":
        return ["failed"]
    seconds = [row.stages.get("weights"), row.stages.get("solve"), row.seconds]
    peak = None if row.peak_bytes is None else row.peak_bytes / 2**20
    return [
        *_figures(row, _COST_FIGURES),
        *(_fixed(s, 4) for s in seconds),
        _fixed(peak, 1),
        *_figures(row, _FAULTS),
    ]


def _figures(row: "Entry", chosen: Figures) -> list[str]:
    return [_fixed(row.figures[name], digits) for name, digits in chosen.values()]


def print_table1(sizes: "list[Size]", repeats: int) -> None:
    """Table 1 of the source beside the measured values."""
    from circparam.compare.kim2019 import PRINTED_RATIOS

    click.echo(f"Table 1 of the source (Kim 2019), median of {repeats} repeats, ms [quartiles]")
    rows = {}
    for s in sizes:
        spreads = [
            f"{1e3 * x.median:.2f} [{1e3 * x.low:.2f} {1e3 * x.high:.2f}]"
            for x in (s.circle, s.floater)
        ]
        ratios = [_fixed(s.ratio, 3), _fixed(s.paper_ratio, 3), _fixed(s.weights_ratio, 2)]
        rows[str(s.vertices)] = [*spreads, *ratios]
    heads = ("circle", "Floater", "ratio", "paper", "weights")
    console().print(columns("vertices", heads, rows))
    click.echo(
        f"ratio = Floater / circle; the source has {PRINTED_RATIOS[0]} to {PRINTED_RATIOS[1]}, "
        "its text 20 to 30 %."
    )
    click.echo("weights = the same ratio for the weight stage alone.")
    outside = [
        str(s.vertices) for s in sizes if not PRINTED_RATIOS[0] <= s.ratio <= PRINTED_RATIOS[1]
    ]
    if outside:
        click.echo(f"Outside that range here: {', '.join(outside)} vertices.")
