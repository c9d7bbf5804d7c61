"""Output of a comparison: cost and quality of each row, and Table 1 of the source."""

import textwrap
from typing import TYPE_CHECKING

import click

from circparam.cli.tables import columns, console
from circparam.core.plural import counted

if TYPE_CHECKING:
    from circparam.compare.kim2019 import Size
    from circparam.compare.rows import Comparison, Entry

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
        *(_number(s, 4) for s in seconds),
        _number(peak, 1),
        *_figures(row, _FAULTS),
    ]


def _figures(row: "Entry", chosen: Figures) -> list[str]:
    return [_number(row.figures[name], digits) for name, digits in chosen.values()]


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
        ratios = [_number(s.ratio, 3), _number(s.paper_ratio, 3), _number(s.weights_ratio, 2)]
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


def _number(value: float | int | None, digits: int | None) -> str:
    """A number that stays within its column; without digits a count."""
    if value is None or value != value:
        return "-"
    if digits is None:
        return str(int(value))
    return f"{value:.{digits}f}" if abs(value) < 1000 else f"{value:.3g}"
