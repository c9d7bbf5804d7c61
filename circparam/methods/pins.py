"""Fixed points of a layout."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.cut_mesh import CutMesh


@dataclass(frozen=True, eq=False)
class Pins:
    """Points the user fixes: vertices (k,) of the cut mesh, uv (k, 2) in units of the mesh."""

    vertices: IntArray
    uv: FloatArray

    def __post_init__(self) -> None:
        vertices = np.asarray(self.vertices, np.int64).reshape(-1)
        uv = np.asarray(self.uv, np.float64)
        if uv.shape != (len(vertices), 2):
            raise OptionError(f"{len(vertices)} pins need as many (u, v), not shape {uv.shape}")
        if not np.isfinite(uv).all():
            raise OptionError("a pin has a coordinate that is not finite")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "uv", uv)


def check_pins(cut_mesh: CutMesh, pins: Pins, fewest: int) -> None:
    """Raise OptionError for pins outside the cut mesh, given twice, or fewer than ``fewest`` on a chart."""
    v = pins.vertices
    outside = (v < 0) | (v >= cut_mesh.n_vertices)
    if outside.any():
        raise OptionError(
            f"pin on vertex {int(v[outside][0])}: the surface has vertices 0..{cut_mesh.n_vertices - 1}"
        )
    values, count = np.unique(v, return_counts=True)
    if (count > 1).any():
        raise OptionError(f"vertex {int(values[count > 1][0])} is pinned twice: give it one place")
    per_chart = np.bincount(cut_mesh.vertex_chart[v], minlength=cut_mesh.n_charts)
    few = np.flatnonzero((per_chart > 0) & (per_chart < fewest))
    if len(few) or len(v) == 0:
        chart = int(few[0]) if len(few) else 0
        raise OptionError(
            f"chart {chart} has {int(per_chart[chart])} pins: this method needs {fewest} or more "
            "on a chart, or none"
        )
    place = np.column_stack([cut_mesh.vertex_chart[v], pins.uv])
    if len(np.unique(place, axis=0)) < len(place):
        raise OptionError("two pins of a chart have the same place: move one of them")
