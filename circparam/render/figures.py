"""Shared parts of pictures and pages: their options, and the key figures in words."""

from collections.abc import Mapping, Sequence

import numpy as np

from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.pipeline.verify import verify
from circparam.render.colours import DISTORTION_END
from circparam.render.scene import Scene

Figures = Sequence[tuple[str, str]]
INFINITE_STRETCH = 1e50  # stretches beyond it come from faces that are squeezed to nothing
RASTER_TEXELS = 2048  # texels a side on which the packed share is counted, as by default everywhere


@dataclass(frozen=True, eq=False)
class PageImages:
    """The textures of a mesh.

    files: (bytes, media type) of each image. face: (m,) image of each face, −1 for none.
    """

    files: Sequence[tuple[bytes, str]]
    face: IntArray


@dataclass(frozen=True, eq=False)
class PictureOptions:
    """How a picture or a page is made.

    title: the heading. note: words beside it. up: the axis that points up: x, y, z, or auto. padding: of the
    layout, in uv units (0 shows none). scale_end: end of the colour scale of distortion. directions: (d, 3)
    sides to look from, None for the sides with the largest view. samples: along a pixel's side, to smooth
    edges; None takes 3, or 2 for large meshes. charts: their number in the figures; None counts the charts of
    the scene. For pages only: repairs, one line each; images, the mesh's own textures; image_note, why there
    are none.
    """

    title: str = "uv layout"
    note: str = ""
    up: str = "auto"
    padding: float = 0.0
    scale_end: float = DISTORTION_END
    directions: FloatArray | None = None
    samples: int | None = None
    charts: int | None = None
    repairs: tuple[str, ...] = ()
    images: PageImages | None = None
    image_note: str = "this mesh has no texture"


def counts(scene: Scene, options: PictureOptions) -> str:
    """Faces and charts in words, behind the note where there is one."""
    note = options.note
    once = scene.once
    instances = len(scene.faces) - len(once.faces)
    again = f" and {instances:,} shown again" if instances else ""
    charts = once.n_charts if options.charts is None else options.charts
    words = f"{counted(len(once.faces), 'face')}{again} · {counted(charts, 'chart')}"
    return f"{note} · {words}" if note else words


def scene_figures(scene: Scene) -> list[tuple[str, str]]:
    """The key figures of a scene, for pictures made without a report at hand; few where no face has an area."""
    once = scene.once
    try:
        found = verify(once.surface, once.uvmap, resolution=RASTER_TEXELS, padding=4)
    except InputError:
        return [("charts", f"{once.n_charts:,}"), ("flips", f"{int(once.flipped.sum()):,}")]
    return as_figures(found.numbers())


# names of measures in reports → their labels in pictures, in order
NAMES = {
    "charts": "charts",
    "distortion": "distortion (1 is perfect)",
    "distortion_max_chart": "worst chart",
    "flips": "flips",
    "overlap": "overlaps",
    "mirrored": "mirrored",
    "seam_length": "seam length, × √area",
    "pack": "packed",
    "gap_texels": "gap, texels",
    "missing": "faces without uv",
    "stretch_l2": "L2 stretch",
    "stretch_linf": "L∞ stretch",
    "angle": "angle distortion",
    "area": "area distortion",
    "border_texels": "border, texels",
    "stretch_p95": "stretch on 95 %",
    "stretch_p99": "stretch on 99 %",
    "stretch_p999": "stretch on 99.9 %",
    "share_over_2": "stretched over 2 times",
    "thin": "charts thinner than 8 texels",
    "seam_texels": "seams, texels",
    "seam_vertices": "vertices that seams add",
    "density_min": "least texels a unit",
    "density_max": "most texels a unit",
    "axis_parallel": "straight borders along the axes",
    "texel_aligned": "straight borders on whole texels",
}


def as_figures(measures: Mapping[str, object] | Figures) -> list[tuple[str, str]]:
    """Measures as (label, text): known ones first, numbers rounded to readable digits; None is left out."""
    pairs = dict(measures)
    out = []
    for name in dict.fromkeys([*NAMES, *pairs]):
        value = pairs.get(name)
        if value is None or (name == "missing" and not value):
            continue
        if name in ("pack", "share_over_2") and isinstance(value, float):
            text = f"{100 * value:.1f} %"
        else:
            text = number_text(value)
        out.append((NAMES.get(name, name.replace("_", " ")), text))
    return out


def number_text(value: object) -> str:
    """A number in readable digits: whole numbers whole, others with five digits."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return str(value)
    number = float(value)
    if abs(number) > INFINITE_STRETCH:
        return "infinite"
    if np.isfinite(number) and number == int(number) and abs(number) < 1e15:
        return f"{int(number):,}"
    return f"{number:.5g}"
