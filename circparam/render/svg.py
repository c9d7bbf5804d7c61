"""The layout as SVG, ready for a drawing program or a paper: charts, a checker on them, and their distortion.

Three squares side by side, each a group of its own (``layout``, ``checker``, ``distortion``). In the first
every chart is one path; in the last faces of one chart and of one step of the colour scale are.
"""

import re
from xml.sax.saxutils import escape

import numpy as np

from circparam.core.arrays import next_half_edge
from circparam.core.graph import cycles
from circparam.core.types import FloatArray, IntArray
from circparam.render import colours as col
from circparam.render.figures import PictureOptions, counts
from circparam.render.scene import Scene
from circparam.render.views import checker_cells, layout_line_weight

SVG_UNITS = 1000  # svg units for one uv unit
COLOUR_STEPS = 24  # of the colour scale


def outlines(scene: Scene, label: IntArray | None = None) -> list[tuple[int, FloatArray]]:
    """Closed outlines of all charts: (chart, (p, 2) uv), charts ascending, holes included.

    label: (m,) outlines of groups with one label, negative ones left out; a label may not reach over several
    charts. The half-edges on a boundary are chained end to start. Where a boundary touches itself in a point,
    the k-th half-edge that arrives continues with the k-th that leaves. This closes every loop too.
    """
    flat = scene.uv_faces.ravel()
    owner = scene.chart if label is None else label
    h = scene.seams if label is None else _borders(scene, label)
    a, b = flat[h], flat[next_half_edge(h)]
    piece = owner[h // 3]
    leaving, arriving = np.lexsort((a, piece)), np.lexsort((b, piece))
    ends_meet = np.array_equal(a[leaving], b[arriving])
    if not ends_meet or not np.array_equal(piece[leaving], piece[arriving]):
        # inconsistently oriented faces: draw every boundary edge on its own
        return [(int(c), scene.uv[[i, j]]) for c, i, j in zip(piece, a, b, strict=True)]
    follower = np.empty(len(h), np.int64)
    follower[arriving] = leaving
    _, order, size = cycles(follower)
    loops = np.split(order, np.cumsum(size)[:-1]) if len(size) else []
    out = [(int(piece[loop[0]]), scene.uv[a[loop]]) for loop in loops]
    return sorted(out, key=lambda item: item[0])


def _borders(scene: Scene, label: IntArray) -> IntArray:
    """Half-edges between faces of different labels, and those of the charts' own boundaries."""
    a, b = scene.uv_faces.ravel(), scene.uv_faces[:, [1, 2, 0]].ravel()
    n = len(scene.uv) + 1
    own = np.repeat(label, 3)
    base = int(label.max(initial=0)) + 2
    there = np.where(a >= 0, (a * n + b) * base + own + 1, -1)
    back = np.where(a >= 0, (b * n + a) * base + own + 1, -2)
    return np.flatnonzero(~np.isin(there, back) & (own >= 0))


def figure_svg(scene: Scene, options: PictureOptions) -> str:
    """The layout three times: tiles as squares, charts as paths with their holes."""
    scene = scene.once
    u0, v0, u1, v1 = scene.bounds
    width, height = (u1 - u0) * SVG_UNITS, (v1 - v0) * SVG_UNITS
    pad, text = 0.02 * max(width, height), 0.024 * max(width, height)
    stroke = max(width, height) / 900
    thin = stroke * layout_line_weight(scene)
    head, foot = 3.4 * text, 2.4 * text
    whole = 3 * width + 4 * pad
    view = f"{-pad:g} {-head:g} {whole:g} {height + head + foot:g}"
    colours = col.chart_colours(np.arange(max(scene.n_charts, 1)))
    charts = [
        f'<path id="chart-{chart}" fill="{col.hex_code(col.mix(colours[chart], np.ones(3), 0.5))}" d="{d}"/>'
        for chart, d in _paths(scene).items()
    ]
    pieces = {"layout": "", "checker": _checker(scene), "distortion": _distortion(scene, options)}
    names = {"layout": "Layout", "checker": "Checker", "distortion": "Distortion"}
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" width="1800">',
        f"<title>{_escape(options.title)}</title>",
        f'<rect x="{-pad:g}" y="{-head:g}" width="{whole:g}" height="{height + head + foot:g}" '
        f'fill="{col.PAPER}"/>',
        f'<g font-family="sans-serif" font-size="{text:g}" fill="{col.INK}">',
        f'<text y="{-2.1 * text:g}">{_escape(options.title)}</text>',
        f'<text x="{3 * width + 2 * pad:g}" y="{-2.1 * text:g}" text-anchor="end" fill="{col.MUTED}">'
        f"{_escape(counts(scene, options))}</text>",
        "</g>",
    ]
    for k, (name, inside) in enumerate(pieces.items()):
        fills = charts if name == "layout" else [d.replace(' id="', ' data-id="') for d in charts]
        lines += [
            f'<g id="{name}" transform="translate({k * (width + pad):g})">',
            f'<text y="{-0.6 * text:g}" font-family="sans-serif" font-size="{text:g}" '
            f'fill="{col.INK}">{names[name]}</text>',
            f'<rect width="{width:g}" height="{height:g}" fill="{col.PANEL}"/>',
            f'<g stroke="{col.HAIRLINE}" stroke-width="{stroke:g}" fill="none">',
            *_grid(u0, v0, u1, v1),
            "</g>",
            inside if name == "distortion" else "",
            f'<g stroke="{col.INK}" stroke-width="{thin:g}" stroke-linejoin="round" '
            f'fill-rule="evenodd">',
            *(
                fills
                if name != "distortion"
                else [re.sub(' fill="[^"]*', ' fill="none', d) for d in fills]
            ),
            "</g>",
            inside if name == "checker" else "",
            "</g>",
        ]
    lines.append(_legend(2 * (width + pad), height + 0.5 * text, width, text, options.scale_end))
    return "\n".join([line for line in lines if line] + ["</svg>", ""])


def _paths(scene: Scene, label: IntArray | None = None) -> dict[int, str]:
    """Chart or label → the data of a path with all its loops."""
    u0, _, _, v1 = scene.bounds
    parts: dict[int, list[str]] = {}
    for piece, uv in outlines(scene, label):
        xy = np.stack([uv[:, 0] - u0, v1 - uv[:, 1]], 1) * SVG_UNITS
        points = " ".join(f"{x:.2f},{y:.2f}" for x, y in xy.tolist())
        parts.setdefault(piece, []).append(f"M{points}Z")
    return {piece: "".join(loops) for piece, loops in parts.items()}


def _checker(scene: Scene) -> str:
    """Two fields of a checker as a pattern over all charts, so that a drawing program can scale it."""
    u0, _, _, v1 = scene.bounds
    cell = SVG_UNITS / checker_cells(scene)
    # cells begin at uv 0, wherever the picture does
    x, y = (-u0 * SVG_UNITS) % (2 * cell), (v1 * SVG_UNITS) % (2 * cell)
    everything = "".join(_paths(scene).values())
    return (
        f'<pattern id="cells" patternUnits="userSpaceOnUse" x="{x:g}" y="{y:g}" width="{2 * cell:g}" '
        f'height="{2 * cell:g}"><path fill="{col.INK}" fill-opacity="0.28" '
        f'd="M0,0h{cell:g}v{cell:g}h{-cell:g}zM{cell:g},{cell:g}h{cell:g}v{cell:g}h{-cell:g}z"/></pattern>'
        f'<path id="cells-on-charts" fill="url(#cells)" fill-rule="evenodd" d="{everything}"/>'
    )


def _distortion(scene: Scene, options: PictureOptions) -> str:
    """Faces by steps of the colour scale; flipped ones in a colour of their own."""
    t = col.distortion_position(scene.distortion, options.scale_end)
    step = np.minimum((t * COLOUR_STEPS).astype(np.int64), COLOUR_STEPS - 1)
    step = np.where(scene.flipped, COLOUR_STEPS, step)
    label = np.where(scene.mapped, scene.chart * (COLOUR_STEPS + 1) + step, -1)
    ramp = [*map(col.hex_code, col.distortion_map(2 * COLOUR_STEPS)[1::2]), col.FLIP]
    by_step: dict[int, list[str]] = {}
    for piece, d in _paths(scene, label).items():
        by_step.setdefault(piece % (COLOUR_STEPS + 1), []).append(d)
    # a stroke of the same colour closes the gaps that drawing programs leave between neighbours
    return "".join(
        f'<path fill="{ramp[k]}" stroke="{ramp[k]}" stroke-width="0.4" fill-rule="evenodd" d="{"".join(ds)}"/>'
        for k, ds in sorted(by_step.items())
    )


def _legend(x: float, y: float, width: float, text: float, end: float) -> str:
    """The colour scale below the last square."""
    ramp = col.distortion_map(COLOUR_STEPS)
    left, bar = x + 7 * text, max(width - 14 * text, width / 4)
    each = bar / COLOUR_STEPS
    boxes = "".join(
        f'<rect x="{left + k * each:.2f}" y="{y:.2f}" width="{each * 1.02:.2f}" height="{0.7 * text:.2f}" '
        f'fill="{col.hex_code(c)}"/>'
        for k, c in enumerate(ramp)
    )
    return (
        f'<g font-family="sans-serif" font-size="{0.8 * text:g}" fill="{col.MUTED}">'
        f'<text x="{left - 0.4 * text:g}" y="{y + 0.65 * text:g}" text-anchor="end">1 is perfect</text>{boxes}'
        f'<text x="{left + bar + 0.4 * text:g}" y="{y + 0.65 * text:g}">{end:g} or more</text></g>'
    )


def _grid(u0: float, v0: float, u1: float, v1: float) -> list[str]:
    """Lines between the tiles, none if there would be too many."""
    if max(u1 - u0, v1 - v0) > 64:
        return []
    columns = [(u - u0) * SVG_UNITS for u in range(int(np.ceil(u0)), int(np.floor(u1)) + 1)]
    rows = [(v1 - v) * SVG_UNITS for v in range(int(np.ceil(v0)), int(np.floor(v1)) + 1)]
    width, height = (u1 - u0) * SVG_UNITS, (v1 - v0) * SVG_UNITS
    return [f'<path d="M{x:g},0V{height:g}"/>' for x in columns] + [
        f'<path d="M0,{y:g}H{width:g}"/>' for y in rows
    ]


def _escape(text: str) -> str:
    """Text for XML, which has no place for control characters and halves of surrogate pairs."""
    kept = "".join(c if c >= " " and not "\ud800" <= c <= "\udfff" else "\ufffd" for c in text)
    return escape(kept)
