"""The state of a layout on its way through the fallback cascade."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface

# Distortion at which a chart counts as faulty whatever was promised: that of one scaled by 1 : 1400 throughout,
# since (s² + s⁻²) / 2 = 10⁶, which fills one and a half texels where it should fill 2048.
FAULTY = 1e6


@dataclass(eq=False)
class Cascade:
    """Seams and a layout over them: cut (e,) bool over surface.edges, corners (m, 3, 2) uv of each corner.

    tries: (m,) int64, how many links the chart of each face has been through. again: a flipped chart may be
    mapped by another method (not where the user asked for a convex map of a disk). laid: (m,), 1 for faces
    laid down one by one, 2 and more for those with a regular polygon in their place. bound: distortion above
    which a chart is split where it may be. notes: of methods and seams. repairs: what the
    chain had to do, one line each.
    """

    surface: Surface
    cut: BoolArray
    corners: FloatArray
    tries: IntArray
    again: bool = True
    bound: float = FAULTY
    laid: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    stopped: list[str] = field(default_factory=list)
    iterations: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    notes: list[str] = field(default_factory=list)
    repairs: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.laid) == 0:
            self.laid = np.zeros(len(self.surface.faces), np.int64)

    def open(self) -> tuple[CutMesh, FloatArray]:
        """CutMesh along the seams, and the uv (nv, 2) of their vertices."""
        cut_mesh = self.surface.cut_mesh(self.cut)
        uv = np.zeros((cut_mesh.n_vertices, 2))
        uv[cut_mesh.faces.ravel()] = self.corners.reshape(-1, 2)
        return cut_mesh, uv
