"""Layouts of one mesh side by side, for a comparison, with the same views and the same scale."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TypeAlias

import numpy as np
from PIL import Image

from circparam.compare.rows import Entry
from circparam.core.plural import counted
from circparam.errors import InputError
from circparam.mesh.mesh import Mesh
from circparam.render.camera import best_directions, look_from
from circparam.render.colours import DISTORTION_END
from circparam.render.figures import number_text
from circparam.render.picture import surface_images, to_image
from circparam.render.scene import Scene, make_scene
from circparam.render.views import checker_cells, draw_plan, see, with_seams

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


Pictures: TypeAlias = tuple[Image.Image, Image.Image, Image.Image]  # layout, checker, distortion


def draw_layouts(
    scenes: Sequence[Scene | None], size: int = 300, samples: int = 2
) -> list[Pictures | None]:
    """Layouts of one mesh drawn from the same side of the surface, with one scale of distortion.

    size: pixels of the square layout; the views are size wide and as high as the surface needs.
    """
    view = None
    out: list[Pictures | None] = []
    for scene in scenes:
        if scene is None:
            out.append(None)
            continue
        if view is None:
            direction = best_directions(scene, 1, "auto")[0]
            trial, _ = look_from(scene, direction, "auto").project(scene.used_points, 1000, 1000)
            wide, high = np.ptp(trial, axis=0) + 1e-9
            height = int(size * np.clip(1.06 * high / wide, 0.45, 1.0))  # little empty space
            camera = look_from(scene, direction, "auto", size / height)
            view = see(scene, camera, size, height, samples)
        else:
            view = with_seams(view, scene, camera)
        cells = checker_cells(scene, 22)
        plan = draw_plan(scene, size, samples, cells=cells)
        pictures = surface_images(scene, view, cells, DISTORTION_END)
        out.append((to_image(plan.image), *pictures))
    return out


def scenes_of(mesh: Mesh, rows: Sequence[Entry]) -> list[Scene | None]:
    """The scene of each row; None if it has no layout that can be drawn."""
    scenes: list[Scene | None] = [None] * len(rows)
    for k, row in enumerate(rows):
        layout = row.uvmap
        if layout is not None:
            with suppress(InputError):
                scenes[k] = make_scene(mesh.points, mesh.faces, layout.uv, layout.uv_faces)
    return scenes


def caption(row: Entry) -> str:
    """Charts, distortion and seconds of a row in a few words; unknown values are left out."""
    charts, distortion, time = (row.figure(k) for k in ("charts", "distortion", "seconds"))
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
