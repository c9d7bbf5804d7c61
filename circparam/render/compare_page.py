"""A comparison as one page: methods side by side, a table to sort, plots, and Table 1 of the source."""

import base64
import io
from collections.abc import Sequence
from typing import Any

from PIL import Image, ImageDraw

from circparam._version import __version__
from circparam.render import colours as col
from circparam.render.bars import bars
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
    MethodLayout,
    SideBySide,
    caption,
    cell_text,
    draw_layouts,
    scenes_of,
)
from circparam.render.text import fitted, width, write


def compare_page(meshes: Sequence[SideBySide], sizes: Sequence[Any] = ()) -> str:
    """The page as text: the viewer, then one section a mesh, then Table 1 if it was measured."""
    title = ", ".join(m.title for m in meshes) or "Table 1"
    layouts: list[PageLayout] = []
    numbers: list[list[int | None]] = []
    for k, shown in enumerate(meshes):
        mine: list[int | None] = []
        for row, scene in zip(shown.rows, scenes_of(shown), strict=True):
            mine.append(None if scene is None else len(layouts))
            if scene is not None:
                look = PictureOptions(title=shown.title, up=shown.up)
                layouts.append(PageLayout(row.name, scene, look, _figures(row), k))
        numbers.append(mine)
    sections = [_section(m, numbers[k]) for k, m in enumerate(meshes)]
    if sizes:
        sections.append(_table1(sizes))
    fields = {
        "VERSION": __version__,
        "TITLE": escaped(f"{title}: methods side by side"),
        "ASPECT": f"{aspect(layouts):.4g}" if layouts else "1",
        "STYLE": page_style("style.css") + viewer_file("compare.css"),
        "VIEWER": viewer(drawable(layouts), (), [m.title for m in meshes]) if layouts else "",
        "SECTIONS": "\n".join(sections),
        "SCRIPT": viewer_file("sort.js") + (viewer_script() if layouts else ""),
    }
    return fill_in(viewer_file("compare.html"), fields)


def _figures(row: MethodLayout) -> list[tuple[str, str]]:
    """The figures of a row by the names of the table below."""
    known = [(COLUMNS[k], cell_text(k, row.figures.get(k))) for k in COLUMNS]
    return [("status", row.status), *((name, text) for name, text in known if text != "–")]


def _section(shown: SideBySide, numbers: Sequence[int | None]) -> str:
    drawn = draw_layouts(shown)
    cards = "".join(_card(d, n) for d, n in zip(drawn, numbers, strict=True))
    ramp = ",".join(col.hex_code(c) for c in col.distortion_map(16))
    flips = any(row.figures.get("flips") for row in shown.rows)
    chip = (
        f'<i class="chip" style="background:{col.FLIP}"></i><span>flipped</span>' if flips else ""
    )
    legend = (
        '<p class="legend">Distortion: <span>1 is perfect</span>'
        f'<i style="background:linear-gradient(90deg,{ramp})">'
        f"</i><span>{col.END:g} or more</span>{chip}</p>"
    )
    return (
        f"<section><h2>{escaped(shown.title)}</h2><p>{escaped(shown.note)}</p>"
        f'{legend}<div class="cards">{cards}</div>'
        f"{_table(shown.rows, shown.title)}"
        f'<div class="plots">{bars(shown.rows, "seconds", "Seconds")}'
        f"{bars(shown.rows, 'distortion', 'Distortion (1 is perfect), bars from 1')}</div></section>"
    )


def _card(drawn: DrawnLayout, number: int | None) -> str:
    """Pictures of a row, and a button that shows it in the viewer."""
    row = drawn.row
    badge = "" if row.status == "ok" else f'<em class="{row.status}">{row.status}</em>'
    head = f"<h3>{escaped(row.name)}{badge}</h3>"
    if drawn.images is None:
        reason = escaped(row.error or "no layout")
        return f'<article>{head}<p class="empty">{reason}</p></article>'
    pictures = "".join(
        f'<img alt="{what} of {escaped(row.name)}" src="{png_url(image)}" '
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


def _table(rows: Sequence[MethodLayout], title: str) -> str:
    """All figures, a column only where some row has a value; a click on a heading sorts."""
    keys = [k for k in COLUMNS if any(r.figures.get(k) is not None for r in rows)]
    best = {k: _best(rows, k) for k in keys}
    heads = "".join(
        f'<th scope="col"><button type="button">{escaped(COLUMNS[k])}</button></th>' for k in keys
    )
    body = []
    for row in rows:
        cells = ""
        for k in keys:
            value, least = row.figures.get(k), best[k]
            mark = (
                " class=best" if row.status == "ok" and least is not None and value == least else ""
            )
            number = "" if value is None else repr(float(value))
            cells += f'<td data-value="{number}"{mark}>{cell_text(k, value)}</td>'
        name = escaped(row.name)
        body.append(f'<tr><th scope="row" data-value="{name}">{name}</th>{cells}</tr>')
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="Figures of {escaped(title)}">'
        '<table class="sortable"><thead><tr><th scope="col">'
        f'<button type="button">method</button></th>{heads}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def _best(rows: Sequence[MethodLayout], key: str) -> float | None:
    """The best value of a column among valid rows, where one is better than the others."""
    values = [r.figures.get(key) for r in rows if r.status == "ok"]
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


def compare_plot(meshes: Sequence[SideBySide], columns: int = 5) -> Image.Image:
    """Methods side by side as an image: layout, checker and distortion below each other, figures under them.

    A mesh with one row has its three pictures beside each other.
    """
    size, gap, margin, head = 280, 20, 40, 76
    drawn = [(m, draw_layouts(m, size)) for m in meshes]
    cards = [_card_height(d) for _, d in drawn]
    widest = max(3 if len(d) == 1 else min(columns, len(d)) for _, d in drawn)
    wide = max(2 * margin + widest * size + (widest - 1) * gap, 660)
    heights = [head + c * -(-len(d) // columns) for c, (_, d) in zip(cards, drawn, strict=True)]
    page = Image.new("RGB", (wide, sum(heights) + margin // 2), col.PAPER)
    draw = ImageDraw.Draw(page)
    y = 0
    for (shown, rows), card, height in zip(drawn, cards, heights, strict=True):
        left = draw_scale(page, draw, wide - margin, y + 32, col.END, "distortion 1")
        title = fitted(draw, shown.title, 26, left - margin - 24)
        write(draw, (margin, y + 26), title, 26, col.INK)
        for k, row in enumerate(rows):
            x = margin + (k % columns) * (size + gap)
            _plot_card(page, draw, x, y + head + (k // columns) * card, row, len(rows) == 1)
        y += height
    return page


def _card_height(rows: Sequence[DrawnLayout]) -> int:
    """Room for a name, three pictures and a line of figures."""
    each = [[i.height + 6 for i in row.images] for row in rows if row.images is not None]
    tallest = [max(h) if len(rows) == 1 else sum(h) for h in each]
    return 34 + max(tallest, default=60) + 40


def _plot_card(
    page: Image.Image, draw: ImageDraw.ImageDraw, x: int, y: int, drawn: DrawnLayout, across: bool
) -> None:
    row = drawn.row
    write(draw, (x, y), row.name, 20, col.INK)
    if row.status != "ok":
        write(draw, (x + width(draw, row.name, 20) + 12, y + 4), row.status, 16, col.WARN)
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
