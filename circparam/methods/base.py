"""Input and output of every method."""

from collections.abc import Callable
from dataclasses import field
from typing import TypeAlias

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.registry import Row
from circparam.core.types import FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.pins import Pins
from circparam.solvers.tutte.outer import TutteOptions


@dataclass(frozen=True)
class MethodOptions:
    """Options of all methods; a method ignores those it has no use for.

    start: weight scheme of the convex map that iterative methods begin with. boundary, spacing, polygon: see
    ``circparam.solvers.tutte.boundary``. clamp: lift negative weights to small positive ones.
    tolerance: stop when the energy falls by less than this share in a step; max_iterations (both None: the
    method's own). pins: fixed points, for lscm, arap and isometric. blend: 0 isometric .. 1 conformal.
    lscm: ``spectral`` or ``pinned``. linear: the one-solve form of abf. bff_boundary: None (automatic),
    ``disk``, or (b,) target lengths of the outer boundary's edges in order of their half-edge number.
    repair: mend flipped faces by the foldover-free energy.
    """

    start: str = "circle"
    boundary: str = "circle"
    spacing: str = "arc-length"
    polygon: FloatArray | None = None
    clamp: bool = False
    tolerance: float | None = None
    max_iterations: int | None = None
    pins: Pins | None = None
    blend: float = 0.0
    lscm: str = "spectral"
    linear: bool = False
    bff_boundary: str | FloatArray | None = None
    repair: bool = True

    @property
    def tutte(self) -> TutteOptions:
        """Options of the convex map."""
        return TutteOptions(self.boundary, self.spacing, self.polygon, self.clamp, self.repair)

    def stops(self, tolerance: float, steps: int) -> tuple[float, int]:
        """(tolerance, most iterations) that the user set, or those of the method."""
        limit = steps if self.max_iterations is None else self.max_iterations
        return tolerance if self.tolerance is None else self.tolerance, limit


@dataclass(frozen=True, eq=False)
class Layout:
    """uv (n_vertices, 2) in units of the mesh, charts not packed. iterations (n_charts,). stopped: why each
    chart's iteration ended. notes: messages for the user, one line each.
    """

    uv: FloatArray
    iterations: IntArray
    stopped: list[str]
    notes: list[str] = field(default_factory=list)


Method: TypeAlias = Callable[[CutMesh, MethodOptions, Monitor], Layout]
MethodRow: TypeAlias = Row[Method]

# shared by the rows of several methods with a free boundary
FREE = frozenset({"free-boundary", "reproduces-plane"})
CHECKED = "flips are possible; the result is checked, and mended by the foldover-free energy"


def direct(cut_mesh: CutMesh, uv: FloatArray, notes: list[str]) -> Layout:
    """The layout of a method that solves once."""
    n = cut_mesh.n_charts
    return Layout(uv, np.ones(n, np.int64), ["solved"] * n, notes)
