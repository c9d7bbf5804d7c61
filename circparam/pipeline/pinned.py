"""Pins: vertices of the mesh that lie where the user says, in the coordinates of the written file.

Charts with pins are not packed, which would move them. Impossible pins are errors: before the work where the
format cannot store their places, else before anything is written.
"""

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, mask_of, positions_in, scattered
from circparam.core.plural import counted
from circparam.errors import NoResultError, OptionError
from circparam.formats.document import Document
from circparam.formats.io import rounding
from circparam.geometry.distortion import best_chart_scales
from circparam.geometry.intrinsic import signed_areas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import Mesh, UVMap
from circparam.methods.pins import Pins
from circparam.pipeline.job import Job
from circparam.pipeline.place import Placed, side_by_side

PIN_TOLERANCE = 1e-6  # uv: distance of a vertex from its pin in the written file


def pin_rows(pins: FloatArray) -> tuple[IntArray, FloatArray]:
    """Vertices (p,) and places (p, 2) of rows (vertex, u, v). Raises OptionError for other rows."""
    try:
        rows = np.asarray(pins, np.float64)
    except (TypeError, ValueError):  # a name, or rows of different lengths
        rows = np.empty(())
    if rows.ndim != 2 or rows.shape[1] != 3 or not np.isfinite(rows).all():
        raise OptionError(f"--pin needs rows of a vertex, u and v, not shape {rows.shape}")
    vertices = rows[:, 0].astype(np.int64)
    if (vertices != rows[:, 0]).any():
        raise OptionError(
            "--pin names a vertex by a number that is not an integer: count vertices from 0"
        )
    if len(np.unique(vertices)) < len(vertices):
        raise OptionError("--pin fixes a vertex twice: name each vertex once")
    return vertices, rows[:, 1:]


def check_storable(pins: FloatArray, document: Document, format: str) -> None:
    """Raise OptionError for pins in places that a format stores too coarsely."""
    vertices, places = pin_rows(pins)
    off = np.abs(rounding(format, document)(places) - places).max(1, initial=0.0)
    if off.max(initial=0.0) > PIN_TOLERANCE:
        bad = int(off.argmax())
        raise OptionError(
            f"--pin: {format.upper()} stores uv in single precision, {off[bad]:.1g} off at vertex "
            f"{vertices[bad]}: keep pins between -8 and 8, or write an .obj"
        )


def pins_of(job: Job, cut_mesh: CutMesh, pins: FloatArray) -> Pins:
    """Pins of mesh vertices as pins of the vertices of the cut mesh.

    Raises OptionError for a vertex that no face uses, and for one on a seam, which has several places.
    """
    number, places = pin_rows(pins)
    surface, weld = job.surface, job.repair_report.weld
    bad = np.flatnonzero((number < 0) | (number >= len(weld)))
    vertex = scattered(len(surface.points), surface.faces.ravel(), cut_mesh.faces.ravel())
    if len(bad) == 0:
        bad = np.flatnonzero(vertex[weld[number]] < 0)
    if len(bad):
        raise OptionError(
            f"--pin names vertex {int(number[bad[0]])}, which no face uses: vertices count from 0"
        )
    instances = np.unique(np.stack([surface.faces.ravel(), cut_mesh.faces.ravel()], 1), axis=0)
    seam = np.bincount(instances[:, 0], minlength=len(surface.points))[weld[number]] > 1
    if seam.any():
        raise OptionError(
            f"--pin names vertex {int(number[seam][0])}, which lies on a seam: "
            "pin a vertex inside a chart or on the boundary of the mesh"
        )
    return Pins(vertex[weld[number]], places)


def place_pinned(job: Job, cut_mesh: CutMesh, uv: FloatArray, pins: FloatArray) -> Placed:
    """Charts with pins where they lie (nv, 2); the others to their right, at the same density of texels."""
    uv = np.where(np.isfinite(uv), uv, 0.0)
    vertex = job.repair_report.weld[pin_rows(pins)[0]]
    pinned = mask_of(cut_mesh.n_charts, cut_mesh.chart[np.isin(job.surface.faces, vertex).any(1)])
    if pinned.all():
        return Placed(uv, [])
    part, vertices, _ = cut_mesh.subset(pinned)
    plane = np.abs(signed_areas(part.faces, uv[vertices])).sum()
    density = np.sqrt(plane / part.areas.sum())
    width = float(np.ptp(uv[vertices, 0]))
    other, loose, _ = cut_mesh.subset(~pinned)
    scale = density * best_chart_scales(other, uv[loose])
    row = side_by_side(other, uv[loose] * scale[other.vertex_chart][:, None])
    row[:, 0] += uv[vertices, 0].max() + 0.02 * width - row[:, 0].min()
    row[:, 1] += uv[vertices, 1].min() - row[:, 1].min()
    placed = uv.copy()
    placed[loose] = row
    count = counted(int((~pinned).sum()), "chart")
    return Placed(placed, [f"{count} without pins to the right of those with pins"])


def check_pins(mesh: Mesh, uvmap: UVMap, pins: FloatArray, repairs: list[str]) -> None:
    """Raise NoResultError unless every corner of a pinned vertex lies at its pin, to PIN_TOLERANCE.

    repairs: lines on the layout, for the message.
    """
    vertices, places = pin_rows(pins)
    row = positions_in(len(mesh.points), vertices)
    at = row[mesh.faces]
    pinned = at >= 0
    off = np.abs(uvmap.uv[uvmap.uv_faces[pinned]] - places[at[pinned]]).max(1, initial=0.0)
    off[uvmap.uv_faces[pinned] < 0] = np.inf
    if not (off <= PIN_TOLERANCE).all():
        worst = int(off.argmax())
        why = f": {repairs[-1]}" if repairs else ""
        raise NoResultError(
            f"the layout misses the pin of vertex {vertices[at[pinned][worst]]} by {off[worst]:.2g}{why}; "
            "move the pins nearer to the free layout, or use fewer"
        )
