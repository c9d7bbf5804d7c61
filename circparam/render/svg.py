"""The layout as SVG: one path a chart, ready for a drawing program or a paper."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.graph import cycles
from circparam.render import colours as col
from circparam.render.scene import Scene

SIZE = 1000  # svg units for one uv unit


def outlines(scene: Scene) -> list[tuple[int, FloatArray]]:
    """Closed outlines of all charts: (chart, (p, 2) uv), charts ascending, holes included.

    The boundary half-edges of a chart are chained end to start. Where a boundary touches itself in a point, the
    k-th half-edge that arrives goes on with the k-th that leaves, which closes every loop as well.
    """
    flat = scene.uv_faces.ravel()
    h = scene.seams
    a, b = flat[h], flat[3 * (h // 3) + (h + 1) % 3]
    chart = scene.chart[h // 3]
    leaving, arriving = np.argsort(a, kind="stable"), np.argsort(b, kind="stable")
    if not np.array_equal(a[leaving], b[arriving]):
        # inconsistently oriented faces: draw every boundary edge on its own
        return [(int(c), scene.uv[[i, j]]) for c, i, j in zip(chart, a, b, strict=True)]
    follower = np.empty(len(h), np.int64)
    follower[arriving] = leaving
    _, order, size = cycles(follower)
    loops = np.split(order, np.cumsum(size)[:-1]) if len(size) else []
    out = [(int(chart[loop[0]]), scene.uv[a[loop]]) for loop in loops]
    return sorted(out, key=lambda item: item[0])


def layout_svg(scene: Scene, title: str = "uv layout") -> str:
    """The layout as an SVG document: tiles as squares, every chart as one path with its holes."""
    u0, v0, u1, v1 = scene.bounds
    parts: dict[int, list[str]] = {}
    for chart, uv in outlines(scene):
        xy = np.stack([uv[:, 0] - u0, v1 - uv[:, 1]], 1) * SIZE
        points = " ".join(f"{x:.2f},{y:.2f}" for x, y in xy.tolist())
        parts.setdefault(chart, []).append(f"M{points}Z")
    colours = col.chart_colours(np.arange(max(scene.n_charts, 1)))
    width, height = (u1 - u0) * SIZE, (v1 - v0) * SIZE
    pad = 0.02 * max(width, height)
    stroke = max(width, height) / 900
    view = f"{-pad:g} {-pad:g} {width + 2 * pad:g} {height + 2 * pad:g}"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" width="1000">',
        f"<title>{_escape(title)}</title>",
        f'<rect x="{-pad:g}" y="{-pad:g}" width="{width + 2 * pad:g}" height="{height + 2 * pad:g}" '
        f'fill="{col.PAPER}"/>',
        f'<rect width="{width:g}" height="{height:g}" fill="{col.PANEL}"/>',
        f'<g stroke="{col.HAIRLINE}" stroke-width="{stroke:g}" fill="none">',
        *_grid(u0, v0, u1, v1),
        "</g>",
        f'<g stroke="{col.INK}" stroke-width="{stroke:g}" stroke-linejoin="round" fill-rule="evenodd">',
    ]
    for chart, loops in parts.items():
        fill = col.hex_code(col.mix(colours[chart], np.ones(3), 0.5))
        lines.append(f'<path id="chart-{chart}" fill="{fill}" d="{"".join(loops)}"/>')
    return "\n".join([*lines, "</g>", "</svg>", ""])


def _grid(u0: float, v0: float, u1: float, v1: float) -> list[str]:
    """Lines between the tiles, none where there would be too many to see."""
    if max(u1 - u0, v1 - v0) > 64:
        return []
    columns = [(u - u0) * SIZE for u in range(int(np.ceil(u0)), int(np.floor(u1)) + 1)]
    rows = [(v1 - v) * SIZE for v in range(int(np.ceil(v0)), int(np.floor(v1)) + 1)]
    width, height = (u1 - u0) * SIZE, (v1 - v0) * SIZE
    return [f'<path d="M{x:g},0V{height:g}"/>' for x in columns] + [
        f'<path d="M0,{y:g}H{width:g}"/>' for y in rows
    ]


def _escape(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
