"""One self-contained page: the surface and its layout side by side, to be turned, zoomed and hovered.

Plain WebGL2 of this project's own (the files in ``viewer/``), no network. Several layouts stand beside each
other: before and after, or those of several methods. ``packed`` says how the geometry is stored.
"""

import base64
import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from circparam.core.arrays import ends_of, group_count, group_sum
from circparam.core.records import dataclass
from circparam.render import colours as col
from circparam.render.camera import best_directions, up_vector
from circparam.render.coarser import MOST_PAGE_FACES, coarser
from circparam.render.figures import Figures, PageImages, PictureOptions, counts, scene_figures
from circparam.render.packed import box, pack_geometry, uv_span
from circparam.render.scene import Scene
from circparam.render.templates import (
    data_address,
    document,
    fill_in,
    page_style,
    piece,
    viewer_file,
)
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
    return document(
        options.title,
        counts(scene, options) + part,
        page_style("style.css"),
        viewer(layouts, options.repairs, active=len(layouts) - 1),
        viewer_script(),
        f' style="--aspect: {aspect(layouts):.4g}"',
    )


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
    meta = {
        "distortionEnd": top,
        "distortionEnds": sorted({*col.DISTORTION_ENDS, top}),
        "palette": [col.hex_code(c) for c in col.chart_colours(np.arange(24))],
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
        "active": active,
        "layouts": [
            {**_meta(each), "sections": p.sections} for each, p in zip(layouts, packed, strict=True)
        ],
    }
    lines = "".join(piece("repair", line=line) for line in repairs)
    targets = enumerate(layouts[-1].scene.targets)
    return fill_in(
        viewer_file("viewer.html"),
        hint=HINT,
        LAYOUTS=_choice(layouts, meshes),
        PANELS="".join(_panels(k, each, len(layouts)) for k, each in enumerate(layouts)),
        FIGURES=_table(layouts),
        CHARTS_OF=' · <span id="charts-of"></span>' if len(layouts) > 1 else "",
        REPAIRS=f"<ul>{lines}</ul>" if repairs else "<p>None.</p>",
        MORPHS="".join(piece("morph", k=k, name=name) for k, (name, _) in targets),
        META=json.dumps(meta, separators=(",", ":")).replace("<", "\\u003c"),
        MESHES="\n".join(
            piece("geometry", k=k, DATA=base64.b64encode(p.data).decode())
            for k, p in enumerate(packed)
        ),
    )


def viewer_script() -> str:
    """The program of the viewer."""
    return "\n".join(viewer_file(name) for name in SCRIPTS)


def drawable(layouts: Sequence[PageLayout]) -> list[PageLayout]:
    """Layouts with as few faces as keep a page small, the more of them there are."""
    most = max(MOST_PAGE_FACES // max(len(layouts), 1), min(FEWEST_LAYOUT_FACES, MOST_PAGE_FACES))
    return [each.of_faces(most) for each in layouts]


def _panels(k: int, layout: PageLayout, count: int) -> str:
    """The two panels of a layout, each with its name; those of the first have no number."""
    name, of = (layout.name, f" of {layout.name}") if count > 1 else ("Surface", "")
    return piece("panels", k=k, number=f"-{k}" if k else "", surface=name, of=of)


def _choice(layouts: Sequence[PageLayout], meshes: Sequence[str]) -> str:
    """A box for each layout, and a list of the meshes where there are several; nothing for one layout."""
    if len(layouts) < 2:
        return ""
    options = "".join(piece("mesh", k=k, name=name) for k, name in enumerate(meshes))
    boxes = "".join(piece("box", k=k, name=each.name) for k, each in enumerate(layouts))
    chosen = piece("meshes", OPTIONS=options) if len(meshes) > 1 else ""
    return piece("choice", MESHES=chosen, BOXES=boxes)


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
    cell = "figure" if len(layouts) > 1 else "only"

    def row(label: str, texts: Iterable[str]) -> str:
        cells = "".join(piece(cell, k=k, text=text) for k, text in enumerate(texts))
        return piece("figures", SCOPE=" scope=row" if label else "", label=label, CELLS=cells)

    head = row("", (each.name for each in layouts)) if len(layouts) > 1 else ""
    labels = dict.fromkeys(label for column in columns for label in column)
    return head + "".join(row(n, (column.get(n, "–") for column in columns)) for n in labels)


def _meta(layout: PageLayout) -> dict[str, Any]:
    """Everything of a layout's data that is not geometry."""
    scene, options = layout.scene, layout.options
    images, directions = options.images, options.directions
    if directions is None:
        directions = best_directions(scene, 1, options.up)
    # how thick seams are drawn before anything is zoomed
    start, end = ends_of(scene.faces, scene.seams)
    on_surface = np.linalg.norm(scene.points[end] - scene.points[start], axis=1).sum()
    diagonal = max(float(np.linalg.norm(np.ptp(scene.used_points, axis=0))), 1e-300)
    lines = {
        # both sides of a seam are listed, and half of the surface is seen
        "surface": round(col.line_weight(float(on_surface) / 4 / diagonal), 3),
        "plane": round(layout_line_weight(scene.once), 3),
    }
    files: list[str] = []
    ranges: list[dict[str, int]] = []  # runs of faces with one image, in the order of the faces
    if images is not None:
        files = [data_address(*file) for file in images.files]
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
