"""What pictures and pages share: their options, and the key figures in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, group_sum
from circparam.render.scene import Scene

Figures = Sequence[tuple[str, str]]


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
    layout, in uv units (0 shows none). stretch_end: end of the colour scale, None for the value that 99 % stay
    below. directions: (d, 3) sides to look from, None for those that show most. samples: along a pixel's side,
    to smooth edges; None takes 3, or 2 for large meshes. For pages only: repairs, one line each; images, the
    mesh's own textures; image_note, why there are none.
    """

    title: str = "uv layout"
    note: str = ""
    up: str = "auto"
    padding: float = 0.0
    stretch_end: float | None = None
    directions: FloatArray | None = None
    samples: int | None = None
    repairs: tuple[str, ...] = ()
    images: PageImages | None = None
    image_note: str = "this mesh has no texture"


def scene_figures(
    scene: Scene, covered: tuple[float, float] | None = None
) -> list[tuple[str, str]]:
    """The key figures of a scene as (label, text), for pictures made without a report at hand.

    covered: (share of the tiles in use that is covered, share of that covered more than once), if known.
    """
    ok = np.isfinite(scene.stretch) & scene.mapped
    area = scene.areas
    whole = float(area[ok].sum())
    mean = float((scene.stretch[ok] * area[ok]).sum() / whole) if whole > 0 else float("nan")
    h = scene.inner_seams
    p = scene.points[scene.faces.ravel()]
    seam = np.linalg.norm(p[3 * (h // 3) + (h + 1) % 3] - p[h], axis=1).sum()
    turn = np.sign(group_sum(scene.uv_areas, np.maximum(scene.chart, 0), max(scene.n_charts, 1)))
    out = [
        ("charts", f"{scene.n_charts:,}"),
        ("stretch (1 is perfect)", f"{mean:.4f}"),
        ("flipped faces", f"{int(scene.flipped.sum()):,}"),
        ("mirrored charts", f"{int((turn < 0).sum()):,}"),
        ("seam length / size", f"{seam / np.sqrt(max(area.sum(), 1e-300)):.2f}"),
    ]
    if covered is not None:
        out.append(("covered", f"{100 * covered[0]:.1f} %"))
        out.append(("overlap", f"{100 * covered[1]:.2f} %"))
    if not scene.mapped.all():
        out.append(("faces without uv", f"{int((~scene.mapped).sum()):,}"))
    return out


# what reports call their measures → what pictures call them, in the order in which they are shown
NAMES = {
    "charts": "charts",
    "distortion": "stretch (1 is perfect)",
    "distortion_max_chart": "worst chart",
    "flips": "flipped faces",
    "overlap": "overlaps",
    "mirrored": "mirrored charts",
    "seam_length": "seam length / size",
    "pack": "covered",
    "gap_texels": "gap, texels",
    "missing": "faces without uv",
    "stretch_l2": "L2 stretch",
    "stretch_linf": "L∞ stretch",
    "angle": "angle distortion",
    "area": "area distortion",
    "border_texels": "border, texels",
}


def as_figures(measures: Mapping[str, object] | Figures) -> list[tuple[str, str]]:
    """Measures as (label, text): known ones first, numbers rounded to what one can read; None is left out."""
    pairs = dict(measures.items() if isinstance(measures, Mapping) else measures)
    known = [name for name in NAMES if name in pairs]
    order = [*known, *(name for name in pairs if name not in NAMES)]
    out = []
    for name in order:
        value = pairs[name]
        if value is None or (name == "missing" and not value):
            continue
        share = name == "pack" and isinstance(value, float)
        text = f"{100 * value:.1f} %" if share and isinstance(value, float) else number_text(value)
        out.append((NAMES.get(name, name.replace("_", " ")), text))
    return out


def number_text(value: object) -> str:
    """A number with what one can read of it: whole numbers whole, others with five digits."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return str(value)
    number = float(value)
    if np.isfinite(number) and number == int(number) and abs(number) < 1e15:
        return f"{int(number):,}"
    return f"{number:.5g}"
