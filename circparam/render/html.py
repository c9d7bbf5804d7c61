"""One self-contained page: the surface and its layout side by side, to be turned, zoomed and hovered.

Plain WebGL2 of this project's own (the files in ``viewer/``), no network. The geometry is quantised to 16 bit
a coordinate, stored as differences in byte planes, deflated, and written as base64 text into the page.
"""

from __future__ import annotations

import base64
import html
import json
import zlib
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from typing import Any

import numpy as np

from circparam._version import __version__
from circparam.core.arrays import FloatArray, IntArray, group_count, group_sum, relabel
from circparam.render import colours as col
from circparam.render.camera import best_directions, up_vector
from circparam.render.coarser import MOST, coarser
from circparam.render.figures import Figures, PageImages, PictureOptions, counts, scene_figures
from circparam.render.scene import Scene
from circparam.render.views import checker_cells

SCRIPTS = (
    "decode.js",
    "shaders.js",
    "renderer.js",
    "cameras.js",
    "morphs.js",
    "tools.js",
    "main.js",
)
# codes of distortion: the square root of log(distortion) / log(limit), 0..254; 255 is flipped
DISTORTION_LIMIT = 1000.0
TWICE = "#e5007d"  # what more than one face covers: a hue beside that of flips
HINT = (
    "Drag to turn, scroll to zoom, shift-drag to move; point at a chart, or press , and . "
    "to go through them; click locks one."
)
TOUCH_HINT = (
    "Swipe sideways to turn, pinch to zoom, two fingers to move; tap a chart to find it in both views, "
    "twice to lock it."
)


def page(
    scene: Scene,
    options: PictureOptions | None = None,
    figures: Figures | None = None,
) -> str:
    """The page as text. figures: (label, text) pairs of the table; None writes what the scene itself tells."""
    options = options or PictureOptions()
    whole, scene = scene, coarser(scene, MOST)
    images = options.images
    order = np.arange(len(scene.faces))
    if images is not None:
        if scene.source is not None:  # what is shown again has the image of what it repeats
            images = PageImages(images.files, images.face[scene.source])
            options = replace(options, images=images)
        order = np.argsort(images.face, kind="stable")
    sections, packed = pack_geometry(scene, order)
    meta = _meta(scene, options)
    meta["sections"] = sections
    fields = {
        "VERSION": __version__,
        "TITLE": escaped(options.title),
        "NOTE": escaped(counts(whole, options) + _shown(whole, scene)),
        "HINT": HINT,
        "ASPECT": f"{_aspect(scene):.4g}",
        "FIGURES": _table(figures if figures is not None else scene_figures(whole)),
        "REPAIRS": _list(options.repairs),
        "MORPHS": _sliders(scene),
        "STYLE": page_style("style.css"),
        "META": json.dumps(meta, separators=(",", ":")).replace("</", "<\\/"),
        "MESH": base64.b64encode(packed).decode(),
        "SCRIPT": "\n".join(viewer_file(name) for name in SCRIPTS),
    }
    return fill_in(viewer_file("page.html"), fields)


def fill_in(template: str, fields: dict[str, str]) -> str:
    """Replace every %NAME% of a template; what is filled in is not looked at again."""
    parts = template.split("%")
    out, k = [parts[0]], 1
    while k < len(parts):
        if parts[k] in fields and k + 1 < len(parts):
            out += [fields[parts[k]], parts[k + 1]]
            k += 2
        else:
            out.append("%" + parts[k])
            k += 1
    return "".join(out)


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


def _shown(whole: Scene, scene: Scene) -> str:
    """How many faces are drawn, where that is not all of them."""
    return "" if scene is whole else f" · drawn with {len(scene.faces):,} of the faces"


def _aspect(scene: Scene) -> float:
    """Width over height of the layout's view."""
    u0, v0, u1, v1 = scene.once.bounds
    return float(np.clip((u1 - u0) / (v1 - v0), 0.25, 4.0))


def _table(figures: Figures) -> str:
    return "".join(
        f"<tr><th scope=row>{escaped(label)}</th><td>{escaped(text)}</td></tr>"
        for label, text in figures
    )


def _list(lines: Sequence[str]) -> str:
    if not lines:
        return "<p>None.</p>"
    return "<ul>" + "".join(f"<li>{escaped(line)}</li>" for line in lines) + "</ul>"


def _sliders(scene: Scene) -> str:
    """A slider for each morph target."""
    return "".join(
        f'<label class="tool morph"><span title="{escaped(name)}">{escaped(name)}</span> '
        f'<input type="range" id="morph-{k}" min="0" max="1" step="0.01" value="0"> '
        f'<output id="morph-value-{k}"></output></label>'
        for k, (name, _) in enumerate(scene.targets)
    )


def _meta(scene: Scene, options: PictureOptions) -> dict[str, Any]:
    """Everything of the page's data that is not geometry."""
    _, extent = _box(scene)
    images = options.images
    directions = options.directions
    if directions is None:
        directions = best_directions(scene, 1, options.up)
    top = options.scale_end
    palette = col.chart_colours(np.arange(24))
    return {
        "extent": extent.tolist(),
        "up": up_vector(scene, options.up).tolist(),
        "direction": [round(float(c), 4) for c in directions[0]],
        "insideOut": scene.inside_out,
        "targets": len(scene.targets),
        "uvBox": [*scene.uv.min(0).tolist(), *_uv_span(scene).tolist()],
        "bounds": list(scene.bounds),
        "cells": checker_cells(scene),
        "distortionEnd": top,
        "distortionEnds": sorted({*col.ENDS, top}),
        "palette": [col.hex_code(c) for c in palette],
        "ramp": [col.hex_code(c) for c in col.distortion_map(64)],
        "schemes": {
            name: {key.lower(): code for key, code in scheme.items()}
            for name, scheme in (("light", col.LIGHT), ("dark", col.DARK))
        },
        "flip": col.FLIP,
        "twice": TWICE,
        "noUv": col.NO_UV,
        "lines": _line_weights(scene),
        "charts": _chart_figures(scene.once),
        "hint": HINT,
        "touchHint": TOUCH_HINT,
        "images": [] if images is None else [_data_url(*file) for file in images.files],
        "imageNote": options.image_note,
        "ranges": _ranges(images),
    }


def _line_weights(scene: Scene) -> dict[str, float]:
    """How thick seams are drawn before anything is zoomed, on the surface and in the layout."""
    h, flat = scene.seams, scene.faces.ravel()
    ends = 3 * (h // 3) + (h + 1) % 3
    on_surface = np.linalg.norm(scene.points[flat[ends]] - scene.points[flat[h]], axis=1).sum()
    once = scene.once
    h, corners = once.seams, once.uv_faces.ravel()
    d = once.uv[corners[3 * (h // 3) + (h + 1) % 3]] - once.uv[corners[h]]
    u0, v0, u1, v1 = once.bounds
    diagonal = max(float(np.linalg.norm(np.ptp(scene.used_points, axis=0))), 1e-300)
    return {
        # both sides of a seam are listed, and half of the surface is seen
        "surface": round(col.line_weight(float(on_surface) / 4 / diagonal), 3),
        "plane": round(
            col.line_weight(float(np.linalg.norm(d, axis=1).sum()) / max(u1 - u0, v1 - v0)), 3
        ),
    }


def _data_url(data: bytes, media_type: str) -> str:
    return f"data:{media_type};base64,{base64.b64encode(data).decode()}"


def _ranges(images: PageImages | None) -> list[dict[str, int]]:
    """Runs of faces with the same image, in the order in which faces are stored."""
    if images is None:
        return []
    face = np.sort(images.face)
    values, first, count = np.unique(face, return_index=True, return_counts=True)
    return [
        {"image": int(v), "first": int(f), "count": int(c)}
        for v, f, c in zip(values, first, count, strict=True)
    ]


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


def _box(scene: Scene) -> tuple[FloatArray, FloatArray]:
    used = np.zeros(len(scene.points), bool)
    used[scene.faces] = True
    every = np.concatenate([scene.used_points, *(points[used] for _, points in scene.targets)])
    low, extent = every.min(0), np.ptp(every, axis=0)
    return low, np.where(extent > 0, extent, max(float(extent.max()), 1.0) * 1e-6)


def _uv_span(scene: Scene) -> FloatArray:
    span = np.ptp(scene.uv, axis=0)
    return np.where(span > 0, span, 1e-6)


def pack_geometry(scene: Scene, order: IntArray) -> tuple[list[dict[str, Any]], bytes]:
    """The geometry of a scene, faces in the given order: (sections in the order stored, deflated bytes).

    Vertices are pairs of position and uv, numbered in the order in which faces use them.
    """
    index = np.where(scene.mapped[:, None], scene.uv_faces, len(scene.uv) + scene.weld[scene.faces])
    n, label = relabel(index[order].ravel())
    corner = np.empty(n, np.int64)  # one corner for each vertex
    corner[label[::-1]] = np.arange(len(label))[::-1]
    face, k = order[corner // 3], corner % 3
    low, extent = _box(scene)
    position = _quantise((scene.points[scene.faces[face, k]] - low) / extent)
    uv = _quantise((np.nan_to_num(scene.corner_uv[face, k]) - scene.uv.min(0)) / _uv_span(scene))
    normal = _octahedral(scene.corner_normals[face, k])
    position_of = np.empty(len(order), np.int64)
    position_of[order] = np.arange(len(order))
    seams = 3 * position_of[scene.seams // 3] + scene.seams % 3
    next_new = np.r_[0, np.maximum.accumulate(label)[:-1] + 1]
    parts: list[tuple[str, Any, str]] = [
        ("position", position, "delta"),
        ("uv", uv, "delta"),
        ("normal", normal, "plain"),
        ("index", (next_new - label).astype(np.uint32), "newest"),
        (
            "chart",
            np.where(scene.mapped, scene.chart, 0xFFFF_FFFF)[order].astype(np.uint32),
            "delta",
        ),
        ("distortion", _distortion_codes(scene)[order], "plain"),
        ("density", _density_codes(scene)[order], "plain"),
        ("seams", np.sort(seams).astype(np.uint32), "delta"),
    ]
    for number, (_, points) in enumerate(scene.targets):
        there = replace(scene, points=points, targets=(), base=None, source=None)
        moved = _quantise((points[scene.faces[face, k]] - low) / extent)
        parts += [
            (f"move{number}", moved - position, "plain"),  # wraps; zero where nothing moves
            (f"normal{number}", _octahedral(there.corner_normals[face, k]), "plain"),
        ]
    sections, data = [], []
    for name, array, coding in parts:
        table = array.reshape(len(array), -1)
        if coding == "delta":
            table = np.diff(table, axis=0, prepend=np.zeros((1, table.shape[1]), table.dtype))
        width = table.dtype.itemsize
        little = np.ascontiguousarray(table.astype(table.dtype.newbyteorder("<")))
        planes = little.view(np.uint8).reshape(len(table), table.shape[1], width)
        data.append(np.ascontiguousarray(planes.transpose(1, 2, 0)).tobytes())
        sections.append(
            {
                "name": name,
                "count": len(table),
                "columns": table.shape[1],
                "bytes": width,
                "coding": coding,
            }
        )
    return sections, zlib.compress(b"".join(data), 7)


def _quantise(values: FloatArray) -> Any:
    return np.round(np.clip(values, 0, 1) * 65535).astype(np.uint16)


def _octahedral(normal: FloatArray) -> Any:
    """Directions (n, 3) as two bytes: the sphere folded onto an octahedron, unfolded onto a square."""
    n = normal / np.maximum(np.abs(normal).sum(1, keepdims=True), 1e-12)
    sign = np.where(n[:, :2] >= 0, 1.0, -1.0)
    folded = (1 - np.abs(n[:, [1, 0]])) * sign
    e = np.where(n[:, 2:] < 0, folded, n[:, :2])
    return np.round((e * 0.5 + 0.5) * 255).astype(np.uint8)


def _density_codes(scene: Scene) -> Any:
    """Texel density of every face beside that of all: 0 a quarter of it or less, 255 four times or more."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(np.abs(scene.uv_areas) / scene.areas) / scene.scale
        place = np.nan_to_num(np.log2(ratio), nan=0.0, posinf=2.0, neginf=-2.0)
    # 32 steps are what one sees, and they compress
    return (np.round((np.clip(place, -2, 2) + 2) * 7.75) * 8.2258).astype(np.uint8)


def _distortion_codes(scene: Scene) -> Any:
    t = np.sqrt(col.distortion_position(scene.distortion, DISTORTION_LIMIT))
    out = np.round(t * 254).astype(np.uint8)
    out[scene.flipped] = 255
    return out
