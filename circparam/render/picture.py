"""The picture of a layout: one PNG of the plane, the surface and the distortion; or the layout as SVG."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from circparam.core.files import write_files
from circparam.core.types import FloatArray
from circparam.errors import OutputError
from circparam.formats.materials import encoded_image
from circparam.mesh.mesh import Mesh, UVMap
from circparam.pipeline.result import Result
from circparam.render import colours as col
from circparam.render.camera import best_directions, look_from
from circparam.render.figures import Figures, PictureOptions, as_figures, counts, scene_figures
from circparam.render.html import PageLayout, page
from circparam.render.scene import Scene, make_scene
from circparam.render.svg import figure_svg
from circparam.render.text import fitted, width, write
from circparam.render.views import (
    View,
    checker_cells,
    checker_colours,
    distortion_colours,
    draw_plan,
    paint,
    see,
)

MARGIN_PIXELS = 40


def to_image(array: FloatArray) -> Image.Image:
    """An (h, w, 3 or 4) array of 0..1 as an image on paper."""
    if array.shape[2] == 4:
        alpha = array[..., 3:]
        array = array[..., :3] * alpha + col.rgb(col.PAPER) * (1 - alpha)
    return Image.fromarray(np.round(np.clip(array, 0, 1) * 255).astype(np.uint8), "RGB")


def surface_images(
    scene: Scene, view: View, cells: float, top: float
) -> tuple[Image.Image, Image.Image]:
    """The surface with a checker, and with its distortion.

    cells: of the checker for one uv unit. top: end of the colour scale.
    """
    ink = col.rgb(col.INK)
    checker = paint(view, checker_colours(scene, view, cells), ink)
    distortion = paint(view, distortion_colours(scene, view.face, top), ink, 0.5, 0.5)
    return to_image(checker), to_image(distortion)


def draw_figure(
    scene: Scene, options: PictureOptions | None = None, figures: Figures | None = None
) -> Image.Image:
    """The figure, 1600 pixels wide: layout on the left, checker above distortion on the right, numbers below.

    figures: (label, text) pairs to print; None prints those of the scene itself.
    """
    options = options or PictureOptions()
    factor = options.samples or (3 if len(scene.faces) < 200_000 else 2)
    directions = options.directions
    if directions is None:
        directions = best_directions(scene, 2, options.up)
    top = options.scale_end
    cells = checker_cells(scene)
    plan = draw_plan(scene, 720, min(factor, 2), cells=cells, padding=options.padding)
    wide, high = 370, 345
    views = [
        see(scene, look_from(scene, d, options.up, wide / high), wide, high, factor)
        for d in directions[:2]
    ]
    page = Image.new("RGB", (1600, 1010), col.PAPER)
    draw = ImageDraw.Draw(page)
    line = counts(scene, options)
    write(draw, (1600 - MARGIN_PIXELS, 38), line, 19, col.MUTED, "ra")
    room = 1600 - 2 * MARGIN_PIXELS - 40 - width(draw, line, 19)
    write(draw, (MARGIN_PIXELS, 28), fitted(draw, options.title, 30, room), 30, col.INK)
    draw.line((MARGIN_PIXELS, 80, 1600 - MARGIN_PIXELS, 80), fill=col.HAIRLINE, width=2)
    y = 128
    page.paste(to_image(plan.image), (MARGIN_PIXELS, y))
    u0, v0, u1, v1 = scene.bounds
    beyond = f"outside the unit square: u {u0:.4g} to {u1:.4g}, v {v0:.4g} to {v1:.4g}"
    note = beyond if scene.outside else "the unit square"
    note += "; hatched where it overlaps" if plan.overlap > 1e-4 else ""
    _label(draw, MARGIN_PIXELS, y - 26, "Layout", note)
    for k, view in enumerate(views):
        x = MARGIN_PIXELS + 720 + 40 + k * (wide + 20)
        checker, distortion = surface_images(scene, view, cells, top)
        page.paste(checker, (x, y))
        page.paste(distortion, (x, y + high + 30))
    x = MARGIN_PIXELS + 760
    _label(draw, x, y - 26, "Checker", "in the colours of the charts; seams in black")
    _label(draw, x, y + high + 4, "Distortion", "")
    _legend(page, draw, 1600 - MARGIN_PIXELS, y + high + 6, top, scene)
    _figures(draw, 905, figures if figures is not None else scene_figures(scene))
    return page


def _label(draw: ImageDraw.ImageDraw, x: float, y: float, name: str, note: str) -> None:
    write(draw, (x, y), name, 19, col.INK)
    if note:
        write(draw, (x + width(draw, name, 19) + 12, y + 2), note, 16, col.MUTED)


def _legend(
    page: Image.Image, draw: ImageDraw.ImageDraw, right: int, y: int, top: float, scene: Scene
) -> None:
    """A colour bar from 1 to the end of the scale, on one line that ends at ``right``."""
    for present, code, name in (
        (not scene.mapped.all(), col.NO_UV, "no uv"),
        (scene.flipped.any(), col.FLIP, "flipped"),
    ):
        if present:
            right -= int(width(draw, name, 16))
            write(draw, (right, y), name, 16, col.MUTED)
            draw.rectangle((right - 22, y + 4, right - 8, y + 18), fill=code)
            right -= 42
    draw_scale(page, draw, right, y, top, "1 is perfect")


def draw_scale(
    page: Image.Image, draw: ImageDraw.ImageDraw, right: int, y: int, top: float, begin: str
) -> float:
    """The colour scale of distortion, on one line that ends at ``right``; returns where it begins."""
    text, bar = f"{top:g} or more", 240
    right -= int(width(draw, text, 16))
    write(draw, (right, y), text, 16, col.MUTED)
    left = right - 10 - bar
    page.paste(to_image(np.repeat(col.distortion_map(bar)[None], 12, axis=0)), (left, y + 5))
    draw.rectangle((left - 1, y + 4, left + bar, y + 17), outline=col.HAIRLINE)
    write(draw, (left - 10, y), begin, 16, col.MUTED, "ra")
    return left - 10 - width(draw, begin, 16)


def _figures(draw: ImageDraw.ImageDraw, y: int, figures: Figures) -> None:
    """The key figures in one row: large number, small label."""
    draw.line((MARGIN_PIXELS, y - 18, 1600 - MARGIN_PIXELS, y - 18), fill=col.HAIRLINE, width=2)
    shown = list(figures)[:8]
    step = (1600 - 2 * MARGIN_PIXELS) / max(len(shown), 1)
    for k, (label, text) in enumerate(shown):
        x = MARGIN_PIXELS + k * step
        write(draw, (x, y), fitted(draw, text, 27, step - 12), 27, col.INK)
        write(draw, (x, y + 38), fitted(draw, label, 16, step - 12), 16, col.MUTED)


def save_preview(
    path: str | Path,
    mesh: Mesh,
    uvmap: UVMap,
    measures: Mapping[str, object] | Figures | None = None,
    options: PictureOptions | None = None,
) -> None:
    """Write a PNG (or an SVG, or an HTML page, by the file's ending) of a mesh and its uv.

    measures: figures to print, name → value, by the names of ``figures.NAMES`` or any others; None prints those
    of the layout itself. options: title, padding, repairs and so on. Raises InputError if the mesh has no
    usable uv, OutputError if the file cannot be written or the ending is unknown.
    """
    path = Path(path)
    scene = make_scene(mesh.points, mesh.faces, uvmap.uv, uvmap.uv_faces)
    options = options or PictureOptions(title=path.stem)
    figures = as_figures(measures) if measures is not None else None
    save_scene(path, scene, options, figures)


def save_result(path: str | Path, result: Result, title: str) -> None:
    """Write the picture of a result, with its figures and repairs; see ``save_preview``."""
    o = result.options
    look = PictureOptions(
        title=title,
        note=f"{o.method}, cut {o.cut}",
        padding=o.padding_uv,
        charts=result.verification.charts,
        repairs=tuple(result.repairs),
    )
    save_preview(path, result.mesh, result.layout, result.measures, look)


def save_scene(
    path: Path,
    scene: Scene,
    options: PictureOptions,
    figures: Figures | None = None,
    before: PageLayout | None = None,
) -> None:
    """Write the picture of a scene in the format of the file's ending: .png, .svg or .html.

    before: a layout to stand to the left on a page.

    Raises OutputError if the ending is another, or where the file cannot be written.
    """
    kind = path.suffix.lower()
    if kind == ".png":
        data = encoded_image(draw_figure(scene, options, figures), optimize=True)
    elif kind == ".svg":
        data = figure_svg(scene, options).encode()
    elif kind == ".html":
        data = page(scene, options, figures, before).encode()
    else:
        raise OutputError(f"{path}: the name of a picture must end in .png, .svg or .html")
    write_files({path: data}, overwrite=True)
