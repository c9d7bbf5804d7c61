"""One self-contained page: the surface and its layout side by side, to be turned, zoomed and hovered.

Plain WebGL2 of this project's own (the files in ``viewer/``), no network. Several layouts stand beside each
other: before and after, or those of several methods. ``packed`` says how the geometry is stored.
"""

import base64
import html
import json
import re
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from typing import Any

import numpy as np

from circparam._version import __version__
from circparam.core.arrays import group_count, group_sum, next_half_edge
from circparam.core.records import dataclass
from circparam.render import colours as col
from circparam.render.camera import best_directions, up_vector
from circparam.render.coarser import MOST_PAGE_FACES, coarser
from circparam.render.figures import Figures, PageImages, PictureOptions, counts, scene_figures
from circparam.render.packed import box, pack_geometry, uv_span
from circparam.render.scene import Scene
from circparam.render.views import checker_cells, layout_line_weight

SCRIPTS = [
    f"{name}.js"
    for name in ["decode", "shaders", "renderer", "cameras", "morphs", "tools", "beside", "main"]
]
TWICE = "#e5007d"  # texels under more than one face: a hue beside that of flips
HINT = (
    "Drag to turn, scroll to zoom, shift-drag to move; point at a chart, or press , and . "
    "to go through them; click locks one."
)
TOUCH_HINT = (
    "Swipe sideways to turn, pinch to zoom, two fingers to move; tap a chart to find it in both views, "
    "twice to lock it."
)
# faces that a layout is drawn with at least, however many layouts a page has
FEWEST_LAYOUT_FACES = 20_000


@dataclass(frozen=True, eq=False)
class PageLayout:
    """One layout of a page. name: heading of the layout. figures: (label, text) pairs, None for those of the
    scene itself. mesh: number of its mesh; layouts of one mesh are turned together."""

    name: str
    scene: Scene
    options: PictureOptions
    figures: Figures | None = None
    mesh: int = 0

    def of_faces(self, most: int) -> "PageLayout":
        """With at most about that many faces, and with an image for each of them."""
        scene, options = coarser(self.scene, most), self.options
        if options.images is not None and scene.source is not None:
            # repeated parts have the image of their original
            images = PageImages(options.images.files, options.images.face[scene.source])
            options = replace(options, images=images)
        return replace(self, scene=scene, options=options)


def page(
    scene: Scene,
    options: PictureOptions | None = None,
    figures: Figures | None = None,
    before: PageLayout | None = None,
) -> str:
    """The page as text. figures: (label, text) pairs of the table; None for those of the scene itself. before:
    a layout on the left of it."""
    options = options or PictureOptions()
    layouts = [PageLayout("after", scene, options, figures)]
    if before is not None:
        layouts = [before, *layouts]
    layouts = drawable(layouts)
    drawn = layouts[-1].scene
    part = "" if scene is drawn else f" · drawn with {len(drawn.faces):,} of the faces"
    fields = {
        "VERSION": __version__,
        "TITLE": escaped(options.title),
        "NOTE": escaped(counts(scene, options) + part),
        "ASPECT": f"{aspect(layouts):.4g}",
        "STYLE": page_style("style.css"),
        "VIEWER": viewer(layouts, options.repairs, active=len(layouts) - 1),
        "SCRIPT": viewer_script(),
    }
    return fill_in(viewer_file("page.html"), fields)


def viewer(
    layouts: Sequence[PageLayout],
    repairs: Sequence[str],
    meshes: Sequence[str] = (),
    active: int = 0,
) -> str:
    """The viewer as a part of a page. repairs: lines below the tables. meshes: names to choose from. active:
    the layout whose charts are listed first."""
    images = [each.options.images for each in layouts]
    packed = [
        pack_geometry(each.scene, None if shown is None else shown.face)
        for each, shown in zip(layouts, images, strict=True)
    ]
    # data that all layouts of a page share: colours, and the scale of distortion up to ``top``
    top = layouts[-1].options.scale_end
    palette = col.chart_colours(np.arange(24))
    meta = {
        "distortionEnd": top,
        "distortionEnds": sorted({*col.DISTORTION_ENDS, top}),
        "palette": [col.hex_code(c) for c in palette],
        "ramp": [col.hex_code(c) for c in col.distortion_map(64)],
        "schemes": {
            name: {key.lower(): code for key, code in scheme.items()}
            for name, scheme in (("light", col.LIGHT), ("dark", col.DARK))
        },
        "flip": col.FLIP,
        "twice": TWICE,
        "noUv": col.NO_UV,
        "hint": HINT,
        "touchHint": TOUCH_HINT,
    }
    meta["active"] = active
    meta["layouts"] = [
        {**_meta(each), "sections": p.sections} for each, p in zip(layouts, packed, strict=True)
    ]
    lines = "".join(f"<li>{escaped(line)}</li>" for line in repairs)
    fields = {
        "HINT": HINT,
        "LAYOUTS": _choice(layouts, meshes),
        "PANELS": "".join(_panels(k, each, len(layouts)) for k, each in enumerate(layouts)),
        "FIGURES": _table(layouts),
        "CHARTS_OF": ' · <span id="charts-of"></span>' if len(layouts) > 1 else "",
        "REPAIRS": f"<ul>{lines}</ul>" if repairs else "<p>None.</p>",
        "MORPHS": "".join(
            f'<label class="tool morph"><span title="{escaped(name)}">{escaped(name)}</span> '
            f'<input type="range" id="morph-{k}" min="0" max="1" step="0.01" value="0"> '
            f'<output id="morph-value-{k}"></output></label>'
            for k, (name, _) in enumerate(layouts[-1].scene.targets)
        ),
        "META": json.dumps(meta, separators=(",", ":")).replace("<", "\\u003c"),
        "MESHES": "\n".join(
            f'<script type="text/plain" id="mesh-{k}">{base64.b64encode(p.data).decode()}</script>'
            for k, p in enumerate(packed)
        ),
    }
    return fill_in(viewer_file("viewer.html"), fields)


def viewer_script() -> str:
    """The program of the viewer."""
    return "\n".join(viewer_file(name) for name in SCRIPTS)


def drawable(layouts: Sequence[PageLayout]) -> list[PageLayout]:
    """Layouts with as few faces as keep a page small, the more of them there are."""
    most = max(MOST_PAGE_FACES // max(len(layouts), 1), min(FEWEST_LAYOUT_FACES, MOST_PAGE_FACES))
    return [each.of_faces(most) for each in layouts]


PANEL_LABELS = {
    "surface": "The surface: arrow keys turn it, plus and minus zoom, comma and full stop go through "
    "the charts, Home resets",
    "plane": "The uv layout: arrow keys move it, plus and minus zoom, comma and full stop go through "
    "the charts, Home resets",
}


def _panels(k: int, layout: PageLayout, count: int) -> str:
    """The two panels of a layout, each with its name; those of the first have no number."""
    number = f"-{k}" if k else ""
    name = escaped(layout.name)
    heads = {"surface": name if count > 1 else "Surface", "plane": "Layout"}
    of = f" of {name}" if count > 1 else ""
    names = "".join(
        f'<h2 class="name {kind}-name" id="{kind}-name{number}">{text}</h2>'
        for kind, text in heads.items()
    )
    panels = "".join(
        f'<div id="{kind}{number}" class="panel {kind}" tabindex="0" role="application" '
        f'aria-label="{words.replace(":", of + ":", 1)}"></div>'
        for kind, words in PANEL_LABELS.items()
    )
    return f'<div class="layout" data-layout="{k}">{names}{panels}</div>'


def _choice(layouts: Sequence[PageLayout], meshes: Sequence[str]) -> str:
    """A box for each layout, and a list of the meshes where there are several; nothing for one layout."""
    if len(layouts) < 2:
        return ""
    options = "".join(
        f'<option value="{k}">{escaped(name)}</option>' for k, name in enumerate(meshes)
    )
    chosen = (
        f'<label class="tool">Mesh <select id="of-mesh">{options}</select></label>'
        if len(meshes) > 1
        else ""
    )
    boxes = "".join(
        f'<label class="tool"><input type="checkbox" name="layout" value="{k}"> {escaped(each.name)}</label>'
        for k, each in enumerate(layouts)
    )
    return (
        f'<div class="tool choice" role="group" aria-label="Layouts" '
        f'title="keys: b one or several, [ and ] the next">{chosen}{boxes}</div>'
    )


def fill_in(template: str, fields: dict[str, str]) -> str:
    """Replace every %NAME% of a template; replaced text is not searched again."""
    names = "|".join(map(re.escape, fields))
    return re.sub(f"%({names})%", lambda found: fields[found[1]], template)


def viewer_file(name: str) -> str:
    """The text of a file of the viewer."""
    return (resources.files("circparam.render") / "viewer" / name).read_text("utf-8")


def page_style(name: str) -> str:
    """A style sheet of the viewer with the colours of all pictures filled in."""
    dark = {f"DARK-{name}": code for name, code in col.DARK.items()}
    return fill_in(viewer_file("scheme.css") + viewer_file(name), col.LIGHT | dark)


def escaped(text: str) -> str:
    """Text for a page: no markup, and no halves of surrogate pairs, which names on a disk may hold."""
    return html.escape(text.encode("utf-8", "replace").decode())


def aspect(layouts: Sequence[PageLayout]) -> float:
    """Width over height of the view of the layouts."""
    low_u, low_v, high_u, high_v = np.array([each.scene.once.bounds for each in layouts]).T
    width, height = (high_u - low_u).max(), (high_v - low_v).max()
    return float(np.clip(width / height, 0.25, 4.0))


def _table(layouts: Sequence[PageLayout]) -> str:
    """Figures, a column for each layout."""
    columns = [
        dict(scene_figures(each.scene) if each.figures is None else each.figures)
        for each in layouts
    ]
    head = ""
    if len(layouts) > 1:
        names = "".join(
            f'<td data-figures="{k}">{escaped(each.name)}</td>' for k, each in enumerate(layouts)
        )
        head = f"<tr><th></th>{names}</tr>"
    rows = []
    for label in dict.fromkeys(label for column in columns for label in column):
        cells = "".join(
            f"<td{f' data-figures={k}' if len(columns) > 1 else ''}>{escaped(column.get(label, '–'))}</td>"
            for k, column in enumerate(columns)
        )
        rows.append(f"<tr><th scope=row>{escaped(label)}</th>{cells}</tr>")
    return head + "".join(rows)


def _meta(layout: PageLayout) -> dict[str, Any]:
    """Everything of a layout's data that is not geometry."""
    scene, options = layout.scene, layout.options
    images, directions = options.images, options.directions
    if directions is None:
        directions = best_directions(scene, 1, options.up)
    # how thick seams are drawn before anything is zoomed
    h, flat = scene.seams, scene.faces.ravel()
    along = scene.points[flat[next_half_edge(h)]] - scene.points[flat[h]]
    on_surface = np.linalg.norm(along, axis=1).sum()
    diagonal = max(float(np.linalg.norm(np.ptp(scene.used_points, axis=0))), 1e-300)
    lines = {
        # both sides of a seam are listed, and half of the surface is seen
        "surface": round(col.line_weight(float(on_surface) / 4 / diagonal), 3),
        "plane": round(layout_line_weight(scene.once), 3),
    }
    files: list[str] = []
    ranges: list[dict[str, int]] = []  # runs of faces with one image, in the order of the faces
    if images is not None:
        coded = ((kind, base64.b64encode(data).decode()) for data, kind in images.files)
        files = [f"data:{kind};base64,{text}" for kind, text in coded]
        runs = np.unique(np.sort(images.face), return_index=True, return_counts=True)
        keys = ("image", "first", "count")
        ranges = [dict(zip(keys, map(int, run), strict=True)) for run in zip(*runs, strict=True)]
    return {
        "name": layout.name,
        "mesh": layout.mesh,
        "extent": box(scene)[1].tolist(),
        "up": up_vector(scene, options.up).tolist(),
        "direction": [round(float(c), 4) for c in directions[0]],
        "insideOut": scene.inside_out,
        "targets": len(scene.targets),
        "uvBox": [*scene.uv.min(0).tolist(), *uv_span(scene).tolist()],
        "bounds": list(scene.bounds),
        "cells": checker_cells(scene),
        "lines": lines,
        "charts": _chart_figures(scene.once),
        "images": files,
        "imageNote": options.image_note,
        "ranges": ranges,
    }


def _chart_figures(scene: Scene) -> dict[str, list[float]]:
    """Faces, share of the surface, and mean distortion of every chart."""
    n = scene.n_charts
    ok = scene.mapped
    chart = scene.chart[ok]
    area = scene.areas[ok]
    finite = np.isfinite(scene.distortion[ok])
    sums = group_sum(np.where(finite, scene.distortion[ok], 0.0) * area, chart, n)
    held = group_sum(area, chart, n)
    weight = group_sum(area * finite, chart, n)
    distortion = np.divide(sums, weight, out=np.ones(n), where=weight > 0)
    whole = max(float(scene.areas.sum()), 1e-300)
    return {
        "faces": group_count(chart, n).tolist(),
        "share": [float(f"{x:.4g}") for x in held / whole],
        "distortion": [float(f"{x:.5g}") for x in distortion],
    }
