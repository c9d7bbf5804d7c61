"""A comparison as one page: methods side by side, a table to sort, plots, and Table 1 of the source.

Bar charts are SVG, on a logarithmic scale where values spread over more than a decade.
"""

import base64
import html
import io
import math
import os
from collections.abc import Sequence
from typing import Any

from PIL import Image, ImageDraw

from circparam._version import __version__
from circparam.compare.rows import Comparison, Entry
from circparam.core.records import dataclass
from circparam.render import colours as col
from circparam.render.figures import PictureOptions
from circparam.render.html import (
    PageLayout,
    aspect,
    drawable,
    escaped,
    fill_in,
    page_style,
    viewer,
    viewer_file,
    viewer_script,
)
from circparam.render.picture import draw_scale
from circparam.render.side_by_side import (
    COLUMNS,
    DrawnLayout,
    caption,
    cell_text,
    draw_layouts,
    scenes_of,
)
from circparam.render.text import fitted, width, write

STAGE_COLOURS = (col.CHARTS[0], col.CHARTS[1], col.CHARTS[4], col.CHARTS[2])
REST_COLOUR = col.NO_UV
# width of a letter of the labels, in units of the drawing: a little more than most need
LETTER_WIDTH = 8.0
CHART_UNITS, BAR_UNITS, ROW_UNITS = 640, 300, 30
LEAST_DRAWN_VALUE = 1e-4  # lower values are drawn as this one: nobody tells them apart
PLOT_COLUMNS = 5  # layouts beside each other in an image
MOST_INTERVALS = 6  # so many intervals at most: their labels stand apart
LARGEST_DRAWN_VALUE = 1e12  # collapsed faces: no scale reaches so far


def compare_page(meshes: Sequence[Comparison], sizes: Sequence[Any] = ()) -> str:
    """The page as text: the viewer, then one section a mesh, then Table 1 if it was measured."""
    title = ", ".join(_title(m) for m in meshes) or "Table 1"
    layouts: list[PageLayout] = []
    numbers: list[list[int | None]] = []
    for k, shown in enumerate(meshes):
        mine: list[int | None] = []
        for row, scene in zip(shown.rows, scenes_of(shown.shape, shown.rows), strict=True):
            mine.append(None if scene is None else len(layouts))
            if scene is not None:
                look = PictureOptions(title=_title(shown))
                known = [(COLUMNS[k], cell_text(k, row.figure(k))) for k in COLUMNS]
                figures = [("status", row.status), *(pair for pair in known if pair[1] != "–")]
                layouts.append(PageLayout(row.method, scene, look, figures, k))
        numbers.append(mine)
    sections = [_section(m, numbers[k]) for k, m in enumerate(meshes)]
    if sizes:
        sections.append(_table1(sizes))
    fields = {
        "VERSION": __version__,
        "TITLE": escaped(f"{title}: methods side by side"),
        "ASPECT": f"{aspect(layouts):.4g}" if layouts else "1",
        "STYLE": page_style("style.css") + viewer_file("compare.css"),
        "VIEWER": viewer(drawable(layouts), (), [_title(m) for m in meshes]) if layouts else "",
        "SECTIONS": "\n".join(sections),
        "SCRIPT": viewer_file("sort.js") + (viewer_script() if layouts else ""),
    }
    return fill_in(viewer_file("compare.html"), fields)


def _title(shown: Comparison) -> str:
    return os.path.basename(shown.mesh)


def _section(shown: Comparison, numbers: Sequence[int | None]) -> str:
    drawn = draw_layouts(shown.shape, shown.rows)
    cards = "".join(_card(d, n) for d, n in zip(drawn, numbers, strict=True))
    ramp = ",".join(col.hex_code(c) for c in col.distortion_map(16))
    flips = any(row.figure("flips") for row in shown.rows)
    chip = (
        f'<i class="chip" style="background:{col.FLIP}"></i><span>flipped</span>' if flips else ""
    )
    legend = (
        '<p class="legend">Distortion: <span>1 is perfect</span>'
        f'<i style="background:linear-gradient(90deg,{ramp})">'
        f"</i><span>{col.DISTORTION_END:g} or more</span>{chip}</p>"
    )
    return (
        f"<section><h2>{escaped(_title(shown))}</h2><p>{shown.faces:,} faces, cut {escaped(shown.cut)}</p>"
        f'{legend}<div class="cards">{cards}</div>'
        f"{_table(shown.rows, _title(shown))}"
        f'<div class="plots">{bars(shown.rows, "seconds", "Seconds")}'
        f"{bars(shown.rows, 'distortion', 'Distortion (1 is perfect), bars from 1')}</div></section>"
    )


def _card(drawn: DrawnLayout, number: int | None) -> str:
    """Pictures of a row, and a button that shows it in the viewer."""
    row = drawn.row
    badge = "" if row.status == "ok" else f'<em class="{row.status}">{row.status}</em>'
    head = f"<h3>{escaped(row.method)}{badge}</h3>"
    if drawn.images is None:
        reason = escaped(row.error or "no layout")
        return f'<article>{head}<p class="empty">{reason}</p></article>'
    pictures = "".join(
        f'<img alt="{what} of {escaped(row.method)}" src="{png_url(image)}" '
        f'width="{image.width}" height="{image.height}">'
        for what, image in zip(("layout", "checker", "distortion"), drawn.images, strict=True)
    )
    button = f'<p><button type="button" data-show="{number}">Show large</button></p>'
    return f"<article>{head}{pictures}<p>{escaped(caption(row))}</p>{button}</article>"


def png_url(image: Image.Image) -> str:
    """An image as the address of itself, in 128 colours."""
    out = io.BytesIO()
    image.quantize(128, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()


def _table(rows: Sequence[Entry], title: str) -> str:
    """All figures, a column only where some row has a value; a click on a heading sorts."""
    keys = [k for k in COLUMNS if any(r.figure(k) is not None for r in rows)]
    best = {k: _best(rows, k) for k in keys}
    heads = "".join(
        f'<th scope="col"><button type="button">{escaped(COLUMNS[k])}</button></th>' for k in keys
    )
    body = []
    for row in rows:
        cells = ""
        for k in keys:
            value, least = row.figure(k), best[k]
            mark = (
                " class=best" if row.status == "ok" and least is not None and value == least else ""
            )
            number = "" if value is None else repr(float(value))
            cells += f'<td data-value="{number}"{mark}>{cell_text(k, value)}</td>'
        name = escaped(row.method)
        body.append(f'<tr><th scope="row" data-value="{name}">{name}</th>{cells}</tr>')
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="Figures of {escaped(title)}">'
        '<table class="sortable"><thead><tr><th scope="col">'
        f'<button type="button">method</button></th>{heads}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def _best(rows: Sequence[Entry], key: str) -> float | None:
    """The best value of a column among valid rows, where one is better than the others."""
    values = [r.figure(key) for r in rows if r.status == "ok"]
    numbers = [v for v in values if v is not None]
    if len(set(numbers)) < 2:
        return None
    return max(numbers) if key == "pack" else min(numbers)


def _table1(sizes: Sequence[Any]) -> str:
    """Table 1 of the source, measured again: medians in milliseconds, and both ratios."""
    rows = []
    for s in sizes:
        paper = "–" if s.paper_ratio is None else f"{s.paper_ratio:.3f}"
        rows.append(
            f"<tr><th scope=row>{s.vertices}</th><td>{1e3 * s.circle.median:.3g}</td>"
            f"<td>{1e3 * s.floater.median:.3g}</td><td>{s.ratio:.3f}</td>"
            f"<td>{s.weights_ratio:.3f}</td><td>{paper}</td></tr>"
        )
    heads = "".join(
        f'<th scope="col">{name}</th>'
        for name in (
            "vertices", "circle, ms", "Floater, ms", "Floater / circle", "of the weights alone",
            "in the source",
        )
    )  # fmt: skip
    return (
        "<section><h2>Circle and Floater on the sizes of Table 1</h2>"
        "<p>Medians from the cut mesh to uv. The source (Kim 2019) gives no unit; ratios can be compared, "
        'times cannot.</p><div class="scroll" tabindex="0" role="region" aria-label="Table 1">'
        f"<table><thead><tr>{heads}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div></section>"
    )


def compare_plot(meshes: Sequence[Comparison]) -> Image.Image:
    """Methods side by side as an image: layout, checker and distortion below each other, figures under them.

    A mesh with one row has its three pictures beside each other.
    """
    size, gap, margin, head = 280, 20, 40, 76
    drawn = [(m, draw_layouts(m.shape, m.rows, size)) for m in meshes]
    # room for a name, three pictures and a line of figures
    cards = []
    for _, rows in drawn:
        each = [[i.height + 6 for i in row.images] for row in rows if row.images is not None]
        tallest = max([max(h) if len(rows) == 1 else sum(h) for h in each], default=60)
        cards.append(34 + tallest + 40)
    widest = max(3 if len(d) == 1 else min(PLOT_COLUMNS, len(d)) for _, d in drawn)
    wide = max(2 * margin + widest * size + (widest - 1) * gap, 660)
    heights = [
        head + c * -(-len(d) // PLOT_COLUMNS) for c, (_, d) in zip(cards, drawn, strict=True)
    ]
    page = Image.new("RGB", (wide, sum(heights) + margin // 2), col.PAPER)
    draw = ImageDraw.Draw(page)
    y = 0
    for (shown, rows), card, height in zip(drawn, cards, heights, strict=True):
        left = draw_scale(page, draw, wide - margin, y + 32, col.DISTORTION_END, "distortion 1")
        title = fitted(draw, _title(shown), 26, left - margin - 24)
        write(draw, (margin, y + 26), title, 26, col.INK)
        for k, row in enumerate(rows):
            x = margin + (k % PLOT_COLUMNS) * (size + gap)
            _plot_card(page, draw, x, y + head + (k // PLOT_COLUMNS) * card, row, len(rows) == 1)
        y += height
    return page


def _plot_card(
    page: Image.Image, draw: ImageDraw.ImageDraw, x: int, y: int, drawn: DrawnLayout, across: bool
) -> None:
    row = drawn.row
    write(draw, (x, y), row.method, 20, col.INK)
    if row.status != "ok":
        write(draw, (x + width(draw, row.method, 20) + 12, y + 4), row.status, 16, col.WARN)
    if drawn.images is None:
        write(draw, (x, y + 60), "no layout", 16, col.MUTED)
        return
    left, top, bottom = x, y + 34, y + 34
    for image in drawn.images:
        page.paste(image, (left, top))
        bottom = max(bottom, top + image.height + 6)
        left, top = (left + image.width + 20, top) if across else (left, bottom)
    room = 3 * 280 + 2 * 20 if across else 280
    write(draw, (x, bottom + 2), fitted(draw, caption(row), 16, room), 16, col.MUTED)


@dataclass(frozen=True)
class Scale:
    """From values to shares of the longest bar. ticks: (value, share) of the lines behind the bars."""

    low: float
    high: float
    logarithmic: bool

    def __call__(self, value: float) -> float:
        """How long the bar of a value is, 0 to 1."""
        if not self.logarithmic:
            return min(max(value / self.high, 0.0), 1.0)
        span = math.log10(self.high / self.low)
        return min(max(math.log10(max(value, self.low) / self.low) / span, 0.0), 1.0)

    @property
    def ticks(self) -> list[tuple[float, float]]:
        """The powers of ten of a logarithmic scale, a few of them."""
        if not self.logarithmic:
            return []
        first, last = round(math.log10(self.low)), round(math.log10(self.high))
        step = max(1, math.ceil((last - first) / MOST_INTERVALS))
        return [(10.0**k, self(10.0**k)) for k in range(first, last + 1, step)]


def scale_of(values: Sequence[float]) -> Scale:
    """The scale for some values: whole decades where the largest is more than ten times the smallest."""
    found = [v for v in values if math.isfinite(v) and v < LARGEST_DRAWN_VALUE]
    known = [max(v, LEAST_DRAWN_VALUE) for v in found if v > 0]
    if not known:
        return Scale(0.0, 1.0, False)
    low, high = min(known), max(known)
    if high <= 10 * low:
        return Scale(0.0, high, False)
    return Scale(10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high)), True)


def bars(rows: Sequence[Entry], key: str, title: str) -> str:
    """A bar chart as SVG: seconds by stage, or distortion above 1; a row without a value has no bar."""
    base = 1.0 if key == "distortion" else 0.0
    values = [row.figure(key) for row in rows]
    scale = scale_of([v - base for v in values if v is not None])
    # the stages that take most of the time over all rows, longest first
    total: dict[str, float] = {}
    for name, seconds in (s for row in rows for s in row.stages.items() if key == "seconds"):
        total[name] = total.get(name, 0.0) + seconds
    stages = sorted(total, key=lambda name: -total[name])[: len(STAGE_COLOURS)]
    left = 16 + LETTER_WIDTH * max((len(row.method) for row in rows), default=0)
    top = 60 if scale.logarithmic else 36
    bottom = top + len(rows) * ROW_UNITS
    # thin lines at the decades, with their values above them
    lines = []
    for mark, share in scale.ticks:
        x = left + BAR_UNITS * share
        lines.append(f'<path class="tick" d="M{x:.1f},{top - 8}V{bottom}"/>')
        text = f"{base + mark:g}"
        lines.append(
            f'<text x="{x:.1f}" y="{top - 14}" text-anchor="middle" class="small">{text}</text>'
        )
    for k, (row, value) in enumerate(zip(rows, values, strict=True)):
        y = top + k * ROW_UNITS
        name = html.escape(row.method)
        lines.append(f'<text x="{left - 12:g}" y="{y + 14}" text-anchor="end">{name}</text>')
        if value is None:
            lines.append(f'<text x="{left + 8:g}" y="{y + 14}" class="muted">no value</text>')
            continue
        length = BAR_UNITS * scale(value - base)
        x = float(left)
        for share, colour in bar_parts(row, stages):
            part = length * share
            lines.append(
                f'<rect x="{x:.1f}" y="{y}" width="{part:.1f}" height="19" fill="{colour}"/>'
            )
            x += part
        text = cell_text(key, value)
        lines.append(f'<text x="{x + 8:.1f}" y="{y + 14}" class="muted">{text}</text>')
    lines += _key(stages, bottom + 8)
    how = f"{title}, logarithmic" if scale.logarithmic else title
    wide = max(left + BAR_UNITS + 16 + LETTER_WIDTH * 12, CHART_UNITS)
    return (
        f'<svg class="plot" viewBox="0 0 {wide:g} {bottom + 30}" role="img" aria-label="{html.escape(how)}">'
        f'<text x="0" y="16" class="title">{html.escape(how)}</text>{"".join(lines)}</svg>'
    )


def _key(stages: Sequence[str], y: float) -> list[str]:
    """Which colour is which stage."""
    out, x = [], 0.0
    for name, colour in [
        *zip(stages, STAGE_COLOURS, strict=False),
        *([("other", REST_COLOUR)] * bool(stages)),
    ]:
        out.append(f'<rect x="{x:g}" y="{y:g}" width="12" height="12" fill="{colour}"/>')
        out.append(f'<text x="{x + 18:g}" y="{y + 11:g}" class="muted">{html.escape(name)}</text>')
        x += 34 + LETTER_WIDTH * len(name)
    return out


def bar_parts(row: Entry, stages: Sequence[str]) -> list[tuple[float, str]]:
    """(share, colour) of each part of a bar: its stages and the rest, or one part where none are known."""
    seconds = row.figure("seconds") or 0.0
    known = sum(row.stages.values())
    whole = max(float(seconds), known)
    if not stages or whole <= 0 or known <= 0:
        return [(1.0, STAGE_COLOURS[0] if not stages else REST_COLOUR)]
    parts = [
        (row.stages.get(n, 0.0) / whole, c) for n, c in zip(stages, STAGE_COLOURS, strict=False)
    ]
    return [*parts, (max(1.0 - sum(share for share, _ in parts), 0.0), REST_COLOUR)]
