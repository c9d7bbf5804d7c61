"""Fixed points of a layout."""

import numpy as np

from circparam.core.arrays import group_count, group_sum, mask_of
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.conformal import chart_sums


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

    def mask(self, cut_mesh: CutMesh) -> BoolArray:
        """(n_vertices,) the vertices that are fixed."""
        return mask_of(cut_mesh.n_vertices, self.vertices)


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
    chart, n, of = cut_mesh.vertex_chart[pins.vertices], cut_mesh.n_charts, cut_mesh.vertex_chart
    z, there = (p[:, 0] + 1j * p[:, 1] for p in (uv, pins.uv))
    here = z[pins.vertices]
    count = group_count(chart, n)
    mean_here, mean_there = (chart_sums(x, chart, n) / np.maximum(count, 1) for x in (here, there))
    a, b = here - mean_here[chart], there - mean_there[chart]
    turn = chart_sums(a.conj() * b, chart, n)
    turn = np.divide(turn, np.abs(turn), out=np.ones_like(turn), where=turn != 0)
    spread_a, spread_b = (group_sum(np.abs(x) ** 2, chart, n) for x in (a, b))
    many = (spread_a > 0) & (spread_b > 0)
    size = np.sqrt(np.divide(spread_b, spread_a, out=np.ones(n), where=many))
    moved = (z - mean_here[of]) * turn[of] + (mean_there / size)[of]
    out = np.where((count > 0)[of][:, None], np.stack([moved.real, moved.imag], 1), uv)
    out[pins.vertices] = pins.uv / size[chart][:, None]
    return out, size


def at_pins(cut_mesh: CutMesh, uv: FloatArray, size: FloatArray, pins: Pins | None) -> FloatArray:
    """uv (n_vertices, 2) at the sizes of ``fit_pins``, the pins in their places to the last bit."""
    if pins is None:
        return uv
    uv = uv * size[cut_mesh.vertex_chart][:, None]
    uv[pins.vertices] = pins.uv
    return uv
