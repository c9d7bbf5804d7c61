"""Layouts of one mesh side by side, for a comparison, with the same views and the same scale."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from typing import Any

import numpy as np
from PIL import Image

from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.errors import InputError
from circparam.mesh.mesh import Mesh, UVMap
from circparam.render import colours as col
from circparam.render.camera import Camera, best_directions, look_from
from circparam.render.figures import number_text
from circparam.render.picture import to_image
from circparam.render.scene import Scene, make_scene
from circparam.render.views import (
    View,
    checker_cells,
    checker_colours,
    distortion_colours,
    draw_plan,
    paint,
    see,
    with_seams,
)

COLUMNS = {
    "seconds": "seconds",
    "charts": "charts",
    "distortion": "distortion",
    "distortion_max_chart": "worst chart",
    "stretch_l2": "L2",
    "stretch_linf": "L∞",
    "angle": "angle",
    "area": "area",
    "flips": "flips",
    "overlap": "overlaps",
    "mirrored": "mirrored",
    "seam_length": "seam length",
    "pack": "packed",
    "peak_bytes": "peak MB",
}


@dataclass(frozen=True, eq=False)
class MethodLayout:
    """The layout of one method: a row of a comparison.

    name: of the method. uvmap: its layout, None if it has none. status: ok, invalid or failed, with error.
    figures: values by the keys of COLUMNS. stages: seconds of each stage.
    """

    name: str
    uvmap: UVMap | None
    status: str = "ok"
    figures: Mapping[str, float | int | None] = field(default_factory=dict)
    stages: Mapping[str, float] = field(default_factory=dict)
    error: str = ""


@dataclass(frozen=True, eq=False)
class SideBySide:
    """A mesh and its layouts by several methods.

    title: of the mesh. note: how it was cut. up: the axis that points up: x, y, z or auto.
    """

    title: str
    mesh: Mesh
    rows: Sequence[MethodLayout]
    note: str = ""
    up: str = "auto"


@dataclass(frozen=True, eq=False)
class DrawnLayout:
    """A row and its pictures: layout, checker, distortion; None if the row has no layout."""

    row: MethodLayout
    images: tuple[Image.Image, Image.Image, Image.Image] | None


def side_by_side(comparison: Any, mesh: Mesh, title: str = "", up: str = "auto") -> SideBySide:
    """The rows of a ``circparam.compare.rows.Comparison`` whose rows keep their layout as ``uvmap``."""
    rows = []
    for row in comparison.rows:
        figures = dict(row.figures) | {"seconds": row.seconds, "peak_bytes": row.peak_bytes}
        uvmap = getattr(row, "uvmap", None)
        rows.append(
            MethodLayout(row.method, uvmap, row.status, figures, row.stages, row.error or "")
        )
    note = f"{comparison.faces:,} faces, cut {comparison.cut}"
    return SideBySide(title or comparison.mesh, mesh, rows, note, up)


def draw_layouts(shown: SideBySide, size: int = 300, samples: int = 2) -> list[DrawnLayout]:
    """Every row drawn from the same side of the surface, with one scale of distortion.

    size: pixels of the square layout; the views are size wide and as high as the surface needs.
    """
    scenes = scenes_of(shown)
    height = size
    view: View | None = None
    camera: Camera | None = None
    out = []
    for row, scene in zip(shown.rows, scenes, strict=True):
        if scene is None:
            out.append(DrawnLayout(row, None))
            continue
        if view is None or camera is None:
            direction = best_directions(scene, 1, shown.up)[0]
            trial, _ = look_from(scene, direction, shown.up).project(scene.used_points, 1000, 1000)
            wide, high = np.ptp(trial, axis=0) + 1e-9
            height = int(size * np.clip(1.06 * high / wide, 0.45, 1.0))  # little empty space
            camera = look_from(scene, direction, shown.up, size / height)
            view = see(scene, camera, size, height, samples)
        else:
            view = with_seams(view, scene, camera)
        cells = checker_cells(scene, 22)
        plan = draw_plan(scene, size, samples, cells=cells)
        checker = paint(view, checker_colours(scene, view, cells), col.rgb(col.INK))
        colours = distortion_colours(scene, view.face, col.DISTORTION_END)
        distortion = paint(view, colours, col.rgb(col.INK), 0.5, 0.5)
        out.append(
            DrawnLayout(row, (to_image(plan.image), to_image(checker), to_image(distortion)))
        )
    return out


def scenes_of(shown: SideBySide) -> list[Scene | None]:
    """The scene of each row; None if it has no layout that can be drawn."""
    scenes: list[Scene | None] = [None] * len(shown.rows)
    for k, row in enumerate(shown.rows):
        if row.uvmap is not None:
            mesh, layout = shown.mesh, row.uvmap
            with suppress(InputError):
                scenes[k] = make_scene(mesh.points, mesh.faces, layout.uv, layout.uv_faces)
    return scenes


def caption(row: MethodLayout) -> str:
    """Charts, distortion and seconds of a row in a few words; unknown values are left out."""
    charts, distortion, time = (row.figures.get(k) for k in ("charts", "distortion", "seconds"))
    parts = []
    if charts is not None:
        parts.append(counted(int(charts), "chart"))
    if distortion is not None:
        parts.append(f"distortion {cell_text('distortion', distortion)}")
    if time is not None:
        parts.append(f"{cell_text('seconds', time)}\u00a0s")
    return " · ".join(parts)


def cell_text(key: str, value: float | int | None) -> str:
    """A value of a column as text; an empty cell is a dash."""
    if value is None or not np.isfinite(value):
        return "–" if value is None else "∞"
    if abs(value) > 1e9 and key != "peak_bytes":  # collapsed faces: the digits would say nothing
        return "over 1e9"
    if key == "peak_bytes":
        return f"{value / 1e6:,.0f}"
    if key == "pack":
        return f"{100 * value:.1f} %"
    if key == "seconds":
        return f"{value:.3g}" if value < 100 else f"{value:,.0f}"
    return number_text(float(f"{value:.5g}")) if isinstance(value, float) else f"{value:,}"
