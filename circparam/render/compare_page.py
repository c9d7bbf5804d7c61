"""A comparison as one page: methods side by side, a table to sort, plots, and Table 1 of the source."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from circparam._version import __version__
from circparam.core.files import write_files
from circparam.errors import OptionError
from circparam.render import colours as col
from circparam.render.html import fill_in, page_style, viewer_file
from circparam.render.picture import font, png_bytes, to_image
from circparam.render.side_by_side import (
    COLUMNS,
    DrawnLayout,
    MethodLayout,
    SideBySide,
    caption,
    cell_text,
    draw_layouts,
)

STAGE_COLOURS = (col.CHARTS[0], col.CHARTS[1], col.CHARTS[4], col.CHARTS[2])
REST = col.NO_UV


def save_report(path: str | Path, meshes: Sequence[SideBySide], sizes: Sequence[Any] = ()) -> None:
    """Write the page. sizes: rows of ``circparam.compare.kim2019.measure``. Raises OptionError, OutputError."""
    path = Path(path)
    if path.suffix.lower() != ".html":
        raise OptionError(f"{path}: the report is a page: end its name in .html")
    write_files({path: compare_page(meshes, sizes).encode()}, overwrite=True)


def save_plot(path: str | Path, meshes: Sequence[SideBySide]) -> None:
    """Write the methods side by side as a PNG. Raises OptionError, OutputError."""
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise OptionError(f"{path}: the plot is an image: end its name in .png")
    write_files({path: png_bytes(compare_plot(meshes))}, overwrite=True)


def compare_page(meshes: Sequence[SideBySide], sizes: Sequence[Any] = ()) -> str:
    """The page as text: one section a mesh, then Table 1 where it was measured."""
    title = ", ".join(m.title for m in meshes) or "Table 1"
    sections = [_section(m) for m in meshes]
    if sizes:
        sections.append(_table1(sizes))
    fields = {
        "VERSION": __version__,
        "TITLE": html.escape(f"{title}: methods side by side"),
        "STYLE": page_style("compare.css"),
        "SECTIONS": "\n".join(sections),
        "SCRIPT": viewer_file("sort.js"),
    }
    return fill_in(viewer_file("compare.html"), fields)


def _section(shown: SideBySide) -> str:
    drawn, top = draw_layouts(shown)
    cards = "".join(_card(d) for d in drawn)
    ramp = ",".join(col.hex_code(c) for c in col.stretch_map(16))
    flips = any(row.figures.get("flips") for row in shown.rows)
    chip = (
        f'<i class="chip" style="background:{col.FLIP}"></i><span>flipped</span>' if flips else ""
    )
    legend = (
        f'<p class="legend">Stretch: <span>1, none</span><i style="background:linear-gradient(90deg,{ramp})">'
        f"</i><span>{top:g} or more</span>{chip}</p>"
    )
    return (
        f"<section><h2>{html.escape(shown.title)}</h2><p>{html.escape(shown.note)}</p>"
        f'{legend}<div class="cards">{cards}</div>'
        f"{_table(shown.rows)}"
        f'<div class="plots">{_bars(shown.rows, "seconds", "Seconds")}'
        f"{_bars(shown.rows, 'distortion', 'Stretch (1 is perfect), bars from 1')}</div></section>"
    )


def _card(drawn: DrawnLayout) -> str:
    row = drawn.row
    badge = "" if row.status == "ok" else f'<em class="{row.status}">{row.status}</em>'
    head = f"<h3>{html.escape(row.name)}{badge}</h3>"
    if drawn.images is None:
        reason = html.escape(row.error or "no layout")
        return f'<article>{head}<p class="empty">{reason}</p></article>'
    pictures = "".join(
        f'<img alt="{what} of {html.escape(row.name)}" src="{png_url(image)}" '
        f'width="{image.width}" height="{image.height}">'
        for what, image in zip(("layout", "checker", "stretch"), drawn.images, strict=True)
    )
    return f"<article>{head}{pictures}<p>{html.escape(caption(row))}</p></article>"


def png_url(image: Image.Image) -> str:
    """An image as the address of itself, in 128 colours."""
    out = io.BytesIO()
    image.quantize(128, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()


def _table(rows: Sequence[MethodLayout]) -> str:
    """All figures, a column only where some row has a value; a click on a heading sorts."""
    keys = [k for k in COLUMNS if any(r.figures.get(k) is not None for r in rows)]
    best = {k: _best(rows, k) for k in keys}
    heads = "".join(
        f'<th scope="col"><button type="button">{html.escape(COLUMNS[k])}</button></th>'
        for k in keys
    )
    body = []
    for row in rows:
        cells = "".join(
            f'<td data-value="{_sort_value(row.figures.get(k))}"'
            f"{' class=best' if row.status == 'ok' and _is(row.figures.get(k), best[k]) else ''}>"
            f"{cell_text(k, row.figures.get(k))}</td>"
            for k in keys
        )
        name = html.escape(row.name)
        body.append(f'<tr><th scope="row" data-value="{name}">{name}</th>{cells}</tr>')
    return (
        '<div class="scroll"><table class="sortable"><thead><tr><th scope="col">'
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


def _is(value: float | int | None, best: float | None) -> bool:
    return best is not None and value == best


def _sort_value(value: float | int | None) -> str:
    return "" if value is None else repr(float(value))


def _bars(rows: Sequence[MethodLayout], key: str, title: str) -> str:
    """A bar chart as SVG: seconds by stage, or stretch above 1; a row without a value has no bar."""
    base = 1.0 if key == "distortion" else 0.0
    values = [row.figures.get(key) for row in rows]
    longest = _bar_end([v - base for v in values if v is not None and v < 1e12])
    stages = _main_stages(rows) if key == "seconds" else []
    left, width, step = 130, 330, 30
    lines = []
    for k, (row, value) in enumerate(zip(rows, values, strict=True)):
        y = 36 + k * step
        name = html.escape(row.name)
        lines.append(f'<text x="{left - 12}" y="{y + 14}" text-anchor="end">{name}</text>')
        if value is None:
            lines.append(f'<text x="{left}" y="{y + 14}" class="muted">no value</text>')
            continue
        length = width * min((value - base) / longest, 1.0)
        x = float(left)
        for share, colour in _bar_parts(row, stages):
            part = length * share
            lines.append(
                f'<rect x="{x:.1f}" y="{y}" width="{part:.1f}" height="19" fill="{colour}"/>'
            )
            x += part
        more = " and beyond" if value - base > longest else ""
        text = f"{cell_text(key, value)}{more}"
        lines.append(f'<text x="{x + 8:.1f}" y="{y + 14}" class="muted">{text}</text>')
    bottom = 36 + len(rows) * step + 6
    x = 0.0
    for name, colour in [
        *zip(stages, STAGE_COLOURS, strict=False),
        *([("other", REST)] * bool(stages)),
    ]:
        lines.append(f'<rect x="{x}" y="{bottom}" width="12" height="12" fill="{colour}"/>')
        label = html.escape(name)
        lines.append(f'<text x="{x + 18}" y="{bottom + 11}" class="muted">{label}</text>')
        x += 40 + 7.5 * len(name)
    return (
        f'<svg class="plot" viewBox="0 0 560 {bottom + 20}" role="img" aria-label="{html.escape(title)}">'
        f'<text x="0" y="16" class="title">{html.escape(title)}</text>{"".join(lines)}</svg>'
    )


def _bar_end(lengths: Sequence[float]) -> float:
    """What the longest bar stands for: the largest value, but at most 20 times the median."""
    if not lengths:
        return 1.0
    median = sorted(lengths)[len(lengths) // 2]
    longest = max(lengths)
    return (min(longest, 20 * median) if median > 0 else longest) or 1.0


def _main_stages(rows: Sequence[MethodLayout]) -> list[str]:
    """The stages that take most of the time over all rows, longest first; as many as there are colours."""
    total: dict[str, float] = {}
    for row in rows:
        for name, seconds in row.stages.items():
            total[name] = total.get(name, 0.0) + seconds
    return sorted(total, key=lambda name: -total[name])[: len(STAGE_COLOURS)]


def _bar_parts(row: MethodLayout, stages: Sequence[str]) -> list[tuple[float, str]]:
    """(share, colour) of each part of a bar: its stages and the rest, or one part where none are known."""
    seconds = row.figures.get("seconds") or 0.0
    known = sum(row.stages.values())
    whole = max(float(seconds), known)
    if not stages or whole <= 0 or known <= 0:
        return [(1.0, STAGE_COLOURS[0] if not stages else REST)]
    parts = [
        (row.stages.get(n, 0.0) / whole, c) for n, c in zip(stages, STAGE_COLOURS, strict=False)
    ]
    return [*parts, (max(1.0 - sum(share for share, _ in parts), 0.0), REST)]


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
        f'times cannot.</p><div class="scroll"><table><thead><tr>{heads}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div></section>"
    )


def compare_plot(meshes: Sequence[SideBySide], columns: int = 5) -> Image.Image:
    """Methods side by side as an image: layout, checker and stretch below each other, figures under them.

    A mesh with one row has its three pictures beside each other.
    """
    size, gap, margin, head = 280, 20, 40, 76
    drawn = [(m, *draw_layouts(m, size)) for m in meshes]
    cards = [_card_height(d) for _, d, _ in drawn]
    widest = max(3 if len(d) == 1 else min(columns, len(d)) for _, d, _ in drawn)
    width = max(2 * margin + widest * size + (widest - 1) * gap, 660)
    heights = [head + c * -(-len(d) // columns) for c, (_, d, _) in zip(cards, drawn, strict=True)]
    page = Image.new("RGB", (width, sum(heights) + margin // 2), col.PAPER)
    draw = ImageDraw.Draw(page)
    y = 0
    for (shown, rows, top), card, height in zip(drawn, cards, heights, strict=True):
        draw.text((margin, y + 26), shown.title, font=font(26), fill=col.INK)
        _plot_legend(page, draw, width - margin, y + 32, top)
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
    draw.text((x, y), row.name, font=font(20), fill=col.INK)
    if row.status != "ok":
        at = x + draw.textlength(row.name, font=font(20)) + 12
        draw.text((at, y + 4), row.status, font=font(16), fill=col.CHARTS[5])
    if drawn.images is None:
        draw.text((x, y + 60), "no layout", font=font(16), fill=col.MUTED)
        return
    left, top, bottom = x, y + 34, y + 34
    for image in drawn.images:
        page.paste(image, (left, top))
        bottom = max(bottom, top + image.height + 6)
        left, top = (left + image.width + 20, top) if across else (left, bottom)
    draw.text((x, bottom + 2), caption(row), font=font(17), fill=col.MUTED)


def _plot_legend(
    page: Image.Image, draw: ImageDraw.ImageDraw, right: int, y: int, top: float
) -> None:
    text = f"{top:g} or more"
    left = right - int(draw.textlength(text, font=font(16)))
    draw.text((left, y), text, font=font(16), fill=col.MUTED)
    ramp = col.stretch_map(200)[None].repeat(12, axis=0)
    page.paste(to_image(ramp), (left - 210, y + 5))
    draw.text((left - 220, y), "stretch 1", font=font(16), fill=col.MUTED, anchor="ra")
