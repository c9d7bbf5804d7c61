"""Fixed points of a layout."""

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, group_sum
from circparam.core.records import dataclass
from circparam.errors import OptionError
from circparam.mesh.cut_mesh import CutMesh


@dataclass(frozen=True, eq=False)
class Pins:
    """Points the user fixes: vertices (k,) of the cut mesh, uv (k, 2)."""

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


def fit_pins(cut_mesh: CutMesh, uv: FloatArray, pins: Pins) -> tuple[FloatArray, FloatArray]:
    """Move every pinned chart so that its pins fit best, at its own size, then set the pins to their places.

    Pins give the size of their chart, which is divided out. Otherwise an energy of lengths would draw the rest
    of the chart to its size on the mesh. Returns the uv and the size of each chart (n_charts,), 1 if one pin
    or none tells none; see ``at_pins``.
    """
    chart, n = cut_mesh.vertex_chart[pins.vertices], cut_mesh.n_charts
    here = uv[pins.vertices]
    count = np.maximum(np.bincount(chart, minlength=n), 1)[:, None]
    mean_here = np.stack([group_sum(c.copy(), chart, n) for c in here.T], 1) / count
    mean_there = np.stack([group_sum(c.copy(), chart, n) for c in pins.uv.T], 1) / count
    a = (here - mean_here[chart]) @ np.array([1, 1j])
    b = (pins.uv - mean_there[chart]) @ np.array([1, 1j])
    top = a.conj() * b
    turn = group_sum(top.real.copy(), chart, n) + 1j * group_sum(top.imag.copy(), chart, n)
    spread = [group_sum(np.abs(z) ** 2, chart, n) for z in (a, b)]
    many = (spread[0] > 0) & (spread[1] > 0)
    size = np.where(many, np.sqrt(spread[1] / np.where(many, spread[0], 1.0)), 1.0)
    turn = np.where(np.abs(turn) > 0, turn / np.where(np.abs(turn) > 0, np.abs(turn), 1.0), 1.0)
    pinned = np.bincount(chart, minlength=n) > 0
    of = cut_mesh.vertex_chart
    z = ((uv - mean_here[of]) @ np.array([1, 1j])) * turn[of]
    moved = np.stack([z.real, z.imag], 1) + (mean_there / size[:, None])[of]
    out = np.where(pinned[of][:, None], moved, uv)
    out[pins.vertices] = pins.uv / size[chart][:, None]
    return out, size


def at_pins(cut_mesh: CutMesh, uv: FloatArray, size: FloatArray, pins: Pins | None) -> FloatArray:
    """uv (n_vertices, 2) at the sizes of ``fit_pins``, the pins in their places to the last bit."""
    if pins is None:
        return uv
    uv = uv * size[cut_mesh.vertex_chart][:, None]
    uv[pins.vertices] = pins.uv
    return uv
