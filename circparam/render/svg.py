"""The layout as SVG, ready for a drawing program or a paper: charts, a checker on them, and their distortion.

Three squares side by side, each a group of its own (``layout``, ``checker``, ``distortion``). In the first
every chart is one path; in the last faces of one chart and of one step of the colour scale are.
"""

import re
from typing import Any

import numpy as np

from circparam.core.arrays import ends_of, scattered
from circparam.core.graph import cycles
from circparam.core.types import FloatArray, IntArray
from circparam.render import colours as col
from circparam.render.figures import PictureOptions, counts
from circparam.render.scene import Scene
from circparam.render.templates import fill_in, piece, viewer_file
from circparam.render.views import checker_cells, layout_line_weight

SVG_UNITS = 1000  # svg units for one uv unit
COLOUR_STEPS = 24  # of the colour scale


def outlines(scene: Scene, label: IntArray | None = None) -> list[tuple[int, FloatArray]]:
    """Closed outlines of all charts: (chart, (p, 2) uv), charts ascending, holes included.

    label: (m,) outlines of groups with one label, negative ones left out; a label may not reach over several
    charts. The half-edges on a boundary are chained end to start. Where a boundary touches itself in a point,
    the k-th half-edge that arrives continues with the k-th that leaves. This closes every loop too.
    """
    owner = scene.chart if label is None else label
    h = scene.seams if label is None else _borders(scene, label)
    a, b = ends_of(scene.uv_faces, h)
    piece = owner[h // 3]
    leaving, arriving = np.lexsort((a, piece)), np.lexsort((b, piece))
    ends_meet = np.array_equal(a[leaving], b[arriving])
    if not ends_meet or not np.array_equal(piece[leaving], piece[arriving]):
        # inconsistently oriented faces: draw every boundary edge on its own
        return [(int(c), scene.uv[[i, j]]) for c, i, j in zip(piece, a, b, strict=True)]
    _, order, size = cycles(scattered(len(h), arriving, leaving))
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
    colours = [col.mix(c, np.ones(3), 0.5) for c in col.chart_colours(np.arange(scene.n_charts))]
    paths = [(k, col.hex_code(colours[k]), d) for k, d in _paths(scene).items()]
    shared: dict[str, Any] = {name.lower(): code for name, code in col.LIGHT.items()}
    shared |= {"size": text, "width": width, "height": height}
    groups = ""
    for k, label in enumerate(("Layout", "Checker", "Distortion")):
        kind = "id" if label == "Layout" else "data-id"
        charts = [
            piece("chart", id=kind, chart=chart, d=d, fill="none" if k == 2 else fill)
            for chart, fill, d in paths
        ]
        groups += fill_in(
            viewer_file("square.svg"), name=label.lower(), label=label, x=k * (width + pad), above=-0.6 * text,
            stroke=stroke, thin=stroke * layout_line_weight(scene),
            GRID="\n".join(_grid(u0, v0, u1, v1)), CHARTS="\n".join(charts),
            BELOW=_distortion(scene, options) if label == "Distortion" else "",
            ABOVE=_checker(scene) if label == "Checker" else "", **shared,
        )  # fmt: skip
    whole = fill_in(
        viewer_file("figure.svg"), left=-pad, top=-3.4 * text, whole=3 * width + 4 * pad,
        tall=height + 5.8 * text, line=-2.1 * text, right=3 * width + 2 * pad,
        title=_printable(options.title), counts=_printable(counts(scene, options)), GROUPS=groups,
        LEGEND=_legend(2 * (width + pad), height + 0.5 * text, width, text, options.scale_end),
        **shared,
    )  # fmt: skip
    return re.sub("\n+", "\n", whole)  # where a part is empty


def _paths(scene: Scene, label: IntArray | None = None) -> dict[int, str]:
    """Chart or label → the data of a path with all its loops."""
    u0, _, _, v1 = scene.bounds
    parts: dict[int, list[str]] = {}
    for part, uv in outlines(scene, label):
        xy = np.stack([uv[:, 0] - u0, v1 - uv[:, 1]], 1) * SVG_UNITS
        points = " ".join(f"{x:.2f},{y:.2f}" for x, y in xy.tolist())
        parts.setdefault(part, []).append(f"M{points}Z")
    return {part: "".join(loops) for part, loops in parts.items()}


def _checker(scene: Scene) -> str:
    """Two fields of a checker as a pattern over all charts, so that a drawing program can scale it."""
    u0, _, _, v1 = scene.bounds
    cell = SVG_UNITS / checker_cells(scene)
    # cells begin at uv 0, wherever the picture does
    x, y = (-u0 * SVG_UNITS) % (2 * cell), (v1 * SVG_UNITS) % (2 * cell)
    whole = "".join(_paths(scene).values())
    return piece("cells", x=x, y=y, cell=cell, twice=2 * cell, ink=col.INK, d=whole)


def _distortion(scene: Scene, options: PictureOptions) -> str:
    """Faces by steps of the colour scale; flipped ones in a colour of their own."""
    t = col.distortion_position(scene.distortion, options.scale_end)
    step = np.minimum((t * COLOUR_STEPS).astype(np.int64), COLOUR_STEPS - 1)
    step = np.where(scene.flipped, COLOUR_STEPS, step)
    label = np.where(scene.mapped, scene.chart * (COLOUR_STEPS + 1) + step, -1)
    ramp = [*map(col.hex_code, col.distortion_map(2 * COLOUR_STEPS)[1::2]), col.FLIP]
    by_step: dict[int, list[str]] = {}
    for part, d in _paths(scene, label).items():
        by_step.setdefault(part % (COLOUR_STEPS + 1), []).append(d)
    # a stroke of the same colour closes the gaps that drawing programs leave between neighbours
    parts = (piece("step", fill=ramp[k], d="".join(ds)) for k, ds in sorted(by_step.items()))
    return "".join(parts)


def _legend(x: float, y: float, width: float, text: float, end: float) -> str:
    """The colour scale below the last square."""
    left, bar = x + 7 * text, max(width - 14 * text, width / 4)
    each = bar / COLOUR_STEPS
    size = {"y": f"{y:.2f}", "width": f"{each * 1.02:.2f}", "height": f"{0.7 * text:.2f}"}
    boxes = "".join(
        piece("colour", x=f"{left + k * each:.2f}", fill=col.hex_code(c), **size)
        for k, c in enumerate(col.distortion_map(COLOUR_STEPS))
    )
    return piece(
        "scale", size=0.8 * text, muted=col.MUTED, BOXES=boxes, top=end, low=y + 0.65 * text,
        begin=left - 0.4 * text, end=left + bar + 0.4 * text,
    )  # fmt: skip


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


def _printable(text: str) -> str:
    """Text for XML, which has no place for control characters and halves of surrogate pairs."""
    return "".join(c if c >= " " and not "\ud800" <= c <= "\udfff" else "\ufffd" for c in text)
