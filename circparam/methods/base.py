"""What every method takes and returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from circparam.arrays import FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh import Patches
from circparam.progress import Monitor
from circparam.solve.convex import require_border

__all__ = [
    "Layout",
    "Method",
    "MethodOptions",
    "Pins",
    "check_pins",
    "direct",
    "require_border",
]


@dataclass(frozen=True, eq=False)
class Pins:
    """Points the user fixes: vertices (k,) of the patches, uv (k, 2) in units of the mesh."""

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


@dataclass(frozen=True)
class MethodOptions:
    """Options of all methods; a method ignores those it has no use for.

    start: weight scheme of the convex map that iterative methods begin with. border, spacing, polygon: see
    ``circparam.borders``. clamp: lift negative weights to small positive ones. tolerance: stop when the
    energy falls by less than this share in a step (None: the method's own). max_iterations: None for the
    method's own. pins: fixed points, for lscm, arap and isometric. blend: 0 isometric .. 1 conformal.
    lscm: ``spectral`` or ``pinned``. linear_abf: the one-solve form of abf. bff_border: None (automatic),
    ``disk``, or (b,) target lengths of the outer border's edges in order of their half-edge number.
    repair: mend flipped faces by the foldover-free energy.
    """

    start: str = "circle"
    border: str = "circle"
    spacing: str = "arc-length"
    polygon: FloatArray | None = None
    clamp: bool = False
    tolerance: float | None = None
    max_iterations: int | None = None
    pins: Pins | None = None
    blend: float = 0.0
    lscm: str = "spectral"
    linear_abf: bool = False
    bff_border: str | FloatArray | None = None
    repair: bool = True


@dataclass(frozen=True, eq=False)
class Layout:
    """uv (n_vertices, 2) in units of the mesh, charts not packed. iterations (n_charts,). stopped: why each
    chart's iteration ended. notes: what the user should know, one line each.
    """

    uv: FloatArray
    iterations: IntArray
    stopped: list[str]
    notes: list[str] = field(default_factory=list)


Method: TypeAlias = Callable[[Patches, MethodOptions, Monitor], Layout]


def direct(patches: Patches, uv: FloatArray, notes: list[str]) -> Layout:
    """The layout of a method that solves once."""
    n = patches.n_charts
    return Layout(uv, np.ones(n, np.int64), ["solved"] * n, notes)


def check_pins(patches: Patches, pins: Pins, fewest: int) -> None:
    """Raise OptionError for pins outside the patches, given twice, or fewer than ``fewest`` on a chart."""
    v = pins.vertices
    outside = (v < 0) | (v >= patches.n_vertices)
    if outside.any():
        raise OptionError(
            f"pin on vertex {int(v[outside][0])}: the surface has vertices 0..{patches.n_vertices - 1}"
        )
    values, count = np.unique(v, return_counts=True)
    if (count > 1).any():
        raise OptionError(f"vertex {int(values[count > 1][0])} is pinned twice: give it one place")
    per_chart = np.bincount(patches.vertex_chart[v], minlength=patches.n_charts)
    few = np.flatnonzero((per_chart > 0) & (per_chart < fewest))
    if len(few) or len(v) == 0:
        chart = int(few[0]) if len(few) else 0
        raise OptionError(
            f"chart {chart} has {int(per_chart[chart])} pins: this method needs {fewest} or more "
            "on a chart, or none"
        )
    place = np.column_stack([patches.vertex_chart[v], pins.uv])
    if len(np.unique(place, axis=0)) < len(place):
        raise OptionError("two pins of a chart have the same place: move one of them")
