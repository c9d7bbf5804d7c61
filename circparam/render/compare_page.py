"""A comparison as one page: methods side by side, a table to sort, plots, and Table 1 of the source.

Bar charts are SVG, on a logarithmic scale where values spread over more than a decade.
"""

import itertools
import math
import os
from collections.abc import Sequence
from typing import Any

from PIL import Image, ImageDraw

from circparam.compare.rows import Comparison, Entry
from circparam.core.records import dataclass
from circparam.formats.materials import encoded_image
from circparam.render import colours as col
from circparam.render.figures import PictureOptions
from circparam.render.html import PageLayout, aspect, drawable, viewer, viewer_script
from circparam.render.picture import draw_scale
from circparam.render.scene import Scene
from circparam.render.side_by_side import (
    COLUMNS,
    Pictures,
    caption,
    cell_text,
    draw_layouts,
    scenes_of,
)
from circparam.render.templates import data_address, document, page_style, piece, viewer_file
from circparam.render.text import fitted, width, write

STAGE_COLOURS = (col.CHARTS[0], col.CHARTS[1], col.CHARTS[4], col.CHARTS[2])
REST_COLOUR = col.NO_UV
# width of a letter of the labels, in units of the drawing: a little more than most need
LETTER_WIDTH = 8.0
CHART_UNITS, BAR_UNITS, ROW_UNITS = 640, 300, 30
LEAST_DRAWN_VALUE = 1e-4  # lower values are drawn as this one: nobody tells them apart
PLOT_COLUMNS = 5  # layouts beside each other in an image
PLOT_PIXELS, GAP_PIXELS, MARGIN_PIXELS = 280, 20, 40  # side of a picture, space between, and around
MOST_INTERVALS = 6  # so many intervals at most: their labels stand apart
LARGEST_DRAWN_VALUE = 1e12  # collapsed faces: no scale reaches so far
TABLE1_HEADS = (
    "vertices", "circle, ms", "Floater, ms", "Floater / circle", "of the weights alone", "in the source",
)  # fmt: skip


def compare_page(meshes: Sequence[Comparison], sizes: Sequence[Any] = ()) -> str:
    """The page as text: the viewer, then one section a mesh, then Table 1 if it was measured."""
    title = ", ".join(_title(m) for m in meshes) or "Table 1"
    layouts: list[PageLayout] = []
    sections = []
    for k, shown in enumerate(meshes):
        scenes = scenes_of(shown.shape, shown.rows)
        sections.append(_section(shown, scenes, len(layouts)))
        for row, scene in zip(shown.rows, scenes, strict=True):
            if scene is not None:
                known = [(COLUMNS[k], cell_text(k, row.figure(k))) for k in COLUMNS]
                figures = [("status", row.status), *(pair for pair in known if pair[1] != "–")]
                look = PictureOptions(title=_title(shown))
                layouts.append(PageLayout(row.method, scene, look, figures, k))
    if sizes:
        sections.append(_table1(sizes))
    content = '<div id="report">\n' + "\n".join(sections) + "\n</div>"
    script, shape = viewer_file("sort.js"), "1"
    if layouts:
        names = [_title(m) for m in meshes]
        content = viewer(drawable(layouts), (), names) + content
        script, shape = script + viewer_script(), f"{aspect(layouts):.4g}"
    return document(
        f"{title}: methods side by side",
        "",
        page_style("style.css") + viewer_file("compare.css"),
        content,
        script,
        f' class="report" style="--aspect: {shape}"',
    )


def _title(shown: Comparison) -> str:
    return os.path.basename(shown.mesh)


def _section(shown: Comparison, scenes: Sequence[Scene | None], first: int) -> str:
    """Pictures, figures and plots of a mesh. first: number of its first layout in the viewer."""
    numbers = itertools.count(first)
    drawn = zip(shown.rows, draw_layouts(scenes), strict=True)
    cards = [_card(row, p, None if p is None else next(numbers)) for row, p in drawn]
    flips = any(row.figure("flips") for row in shown.rows)
    plots = (("seconds", "Seconds"), ("distortion", "Distortion (1 is perfect), bars from 1"))
    return piece(
        "compared", title=_title(shown), faces=f"{shown.faces:,}", cut=shown.cut,
        ramp=",".join(col.hex_code(c) for c in col.distortion_map(16)), end=col.DISTORTION_END,
        FLIPS=piece("flips", colour=col.FLIP) if flips else "", CARDS="".join(cards),
        TABLE=_table(shown), PLOTS="".join(bars(shown.rows, *plot) for plot in plots),
    )  # fmt: skip


def _card(row: Entry, pictures: Pictures | None, number: int | None) -> str:
    """Pictures of a row, and a button that shows it in the viewer."""
    if pictures is None:
        content = piece("empty", reason=row.error or "no layout")
    else:
        shown = ""
        for what, image in zip(("layout", "checker", "distortion"), pictures, strict=True):
            size = {"width": image.width, "height": image.height}
            shown += piece("picture", what=what, method=row.method, url=png_url(image), **size)
        content = piece("shown", PICTURES=shown, caption=caption(row), number=number)
    badge = "" if row.status == "ok" else piece("badge", status=row.status)
    return piece("card", method=row.method, BADGE=badge, CONTENT=content)


def png_url(image: Image.Image) -> str:
    """An image as the address of itself, in 128 colours."""
    few = image.quantize(128, dither=Image.Dither.NONE)
    return data_address(encoded_image(few, optimize=True), "image/png")


def _table(shown: Comparison) -> str:
    """All figures, a column only where some row has a value; a click on a heading sorts."""
    keys = [k for k in COLUMNS if any(r.figure(k) is not None for r in shown.rows)]
    best = {k: _best(shown.rows, k) for k in keys}
    body = ""
    for row in shown.rows:
        cells = ""
        for k in keys:
            value = row.figure(k)
            number = "" if value is None else repr(float(value))
            first = row.status == "ok" and value is not None and value == best[k]
            mark = " class=best" if first else ""
            cells += piece("cell", value=number, BEST=mark, text=cell_text(k, value))
        body += piece("row", name=row.method, CELLS=cells)
    heads = "".join(piece("sorting", text=t) for t in ("method", *(COLUMNS[k] for k in keys)))
    label, kind = f"Figures of {_title(shown)}", ' class="sortable"'
    return piece("table", label=label, SORTABLE=kind, HEADS=heads, ROWS=body)


def _best(rows: Sequence[Entry], key: str) -> float | None:
    """The best value of a column among valid rows, where one is better than the others."""
    values = [r.figure(key) for r in rows if r.status == "ok"]
    numbers = [v for v in values if v is not None]
    if len(set(numbers)) < 2:
        return None
    return max(numbers) if key == "pack" else min(numbers)


def _table1(sizes: Sequence[Any]) -> str:
    """Table 1 of the source, measured again: medians in milliseconds, and both ratios."""
    rows = ""
    for s in sizes:
        texts = [
            *(f"{1e3 * times.median:.3g}" for times in (s.circle, s.floater)),
            *(f"{ratio:.3f}" for ratio in (s.ratio, s.weights_ratio)),
            "–" if s.paper_ratio is None else f"{s.paper_ratio:.3f}",
        ]
        cells = "".join(piece("only", text=text) for text in texts)
        rows += piece("figures", SCOPE=" scope=row", label=s.vertices, CELLS=cells)
    heads = "".join(piece("head", text=name) for name in TABLE1_HEADS)
    table = piece("table", label="Table 1", SORTABLE="", HEADS=heads, ROWS=rows)
    return piece("table1", TABLE=table)


def compare_plot(meshes: Sequence[Comparison]) -> Image.Image:
    """Methods side by side as an image: layout, checker and distortion below each other, figures under them.

    A mesh with one row has its three pictures beside each other.
    """
    head = 76
    cards = []
    for shown in meshes:
        drawn = draw_layouts(scenes_of(shown.shape, shown.rows), PLOT_PIXELS)
        alone = len(shown.rows) == 1
        cards.append([_plot_card(*pair, alone) for pair in zip(shown.rows, drawn, strict=True)])
    step = PLOT_PIXELS + GAP_PIXELS
    widest = max(3 if len(row) == 1 else min(PLOT_COLUMNS, len(row)) for row in cards)
    wide = max(2 * MARGIN_PIXELS + widest * step - GAP_PIXELS, 660)
    tallest = [max(card.height for card in row) for row in cards]
    heights = [
        head + tall * -(-len(row) // PLOT_COLUMNS) for tall, row in zip(tallest, cards, strict=True)
    ]
    page = Image.new("RGB", (wide, sum(heights) + MARGIN_PIXELS // 2), col.PAPER)
    draw = ImageDraw.Draw(page)
    y = 0
    for shown, row, tall, height in zip(meshes, cards, tallest, heights, strict=True):
        right = wide - MARGIN_PIXELS
        left = draw_scale(page, draw, right, y + 32, col.DISTORTION_END, "distortion 1")
        title = fitted(draw, _title(shown), 26, left - MARGIN_PIXELS - 24)
        write(draw, (MARGIN_PIXELS, y + 26), title, 26, col.INK)
        for k, card in enumerate(row):
            down, across = divmod(k, PLOT_COLUMNS)
            page.paste(card, (MARGIN_PIXELS + across * step, y + head + down * tall))
        y += height
    return page


def _plot_card(row: Entry, pictures: Pictures | None, across: bool) -> Image.Image:
    """A name, three pictures below or beside each other, and a line of figures."""
    images = pictures or ()
    wide = 3 * PLOT_PIXELS + 2 * GAP_PIXELS if across else PLOT_PIXELS
    each = [image.height + 6 for image in images] or [60]
    bottom = 34 + (max(each) if across else sum(each))
    card = Image.new("RGB", (wide, bottom + 40), col.PAPER)
    draw = ImageDraw.Draw(card)
    write(draw, (0, 0), row.method, 20, col.INK)
    if row.status != "ok":
        write(draw, (width(draw, row.method, 20) + 12, 4), row.status, 16, col.WARN)
    x, y = 0, 34
    for image in images:
        card.paste(image, (x, y))
        x, y = (x + image.width + GAP_PIXELS, y) if across else (x, y + image.height + 6)
    if images:
        write(draw, (0, bottom + 2), fitted(draw, caption(row), 16, wide), 16, col.MUTED)
    else:
        write(draw, (0, 60), "no layout", 16, col.MUTED)
    return card


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
    how = f"{title}, logarithmic" if scale.logarithmic else title
    drawn = [_text(0, 16, how, "title")]
    # thin lines at the decades, with their values above them
    for mark, share in scale.ticks:
        x = left + BAR_UNITS * share
        drawn.append(f'<path class="tick" d="M{x:.1f},{top - 8}V{bottom}"/>')
        drawn.append(_text(x, top - 14, f"{base + mark:g}", "small", "middle"))
    for k, (row, value) in enumerate(zip(rows, values, strict=True)):
        y = top + k * ROW_UNITS
        drawn.append(_text(left - 12, y + 14, row.method, "method", "end"))
        said, length = "no value", 0.0
        if value is not None:
            said, length = cell_text(key, value), BAR_UNITS * scale(value - base)
        x = float(left)
        for share, colour in bar_parts(row, stages) if length else ():
            drawn.append(_rectangle(x, y, length * share, 19, colour))
            x += length * share
        drawn.append(_text(x + 8, y + 14, said, "muted"))
    # which colour is which stage
    names = [*stages, "other"] if stages else []
    x, y = 0.0, bottom + 8
    for name, colour in zip(names, (*STAGE_COLOURS[: len(stages)], REST_COLOUR), strict=False):
        drawn += [_rectangle(x, y, 12, 12, colour), _text(x + 18, y + 11, name, "muted")]
        x += 34 + LETTER_WIDTH * len(name)
    wide = max(left + BAR_UNITS + 16 + LETTER_WIDTH * 12, CHART_UNITS)
    view = f"0 0 {wide:g} {bottom + 30}"
    return piece("plot", view=view, label=how, DRAWN="".join(drawn))


def _text(x: float, y: float, text: str, kind: str, anchor: str = "start") -> str:
    return piece("text", x=x, y=y, text=text, kind=kind, anchor=anchor)


def _rectangle(x: float, y: float, wide: float, high: float, colour: str) -> str:
    return f'<rect x="{x:.1f}" y="{y}" width="{wide:.1f}" height="{high}" fill="{colour}"/>'


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
