"""Least squares conformal maps with a free boundary (Lévy et al. 2002), spectral (Mullen et al. 2008) or
pinned.

The plane is the complex numbers. The conformal energy ½ z* L_C z, Dirichlet energy minus area, has a Hermitian
matrix with one row a vertex, block diagonal over the charts. Nothing guarantees that no face flips.
"""

import numpy as np

from circparam.core.linalg import HeldFactor
from circparam.core.monitor import Monitor
from circparam.core.registry import Row
from circparam.core.types import BoolArray, ComplexArray
from circparam.errors import OptionError
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.base import CHECKED, FREE, Layout, MethodOptions, MethodRow
from circparam.methods.conformal import (
    at_surface_area,
    conformal_matrix,
    conformal_spectral,
    start_modes,
)
from circparam.methods.pins import Pins, check_pins
from circparam.methods.untangled import untangle_layout
from circparam.solvers.tutte.embed import require_boundary
from circparam.solvers.tutte.outer import outer_boundary

LSCM_FORMS = ("spectral", "pinned")


def lscm(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor) -> Layout:
    """The conformal map with a free boundary; charts are at_surface_area to their area on the surface.

    Spectral without pins. With pins, or the option ``lscm``, the pinned form: a chart without pins of the user
    then holds two opposite points of its boundary. Raises OptionError for bad pins.
    """
    if options.lscm not in LSCM_FORMS:
        raise OptionError(f"unknown form of lscm {options.lscm!r}: {' or '.join(LSCM_FORMS)}")
    require_boundary(cut_mesh)
    with monitor.stage("solve"):
        if options.pins is not None or options.lscm == "pinned":
            z, pinned = conformal_pinned(cut_mesh, options.pins)
            steps = np.ones(cut_mesh.n_charts, np.int64)
        else:
            z, steps = conformal_spectral(cut_mesh, start_modes(cut_mesh))
            pinned = np.zeros(cut_mesh.n_charts, bool)
        uv = at_surface_area(cut_mesh, np.stack([z.real, z.imag], 1), ~pinned)
    still = None if options.pins is None else options.pins.mask(cut_mesh)
    uv, notes = untangle_layout(cut_mesh, uv, "lscm", options, monitor, still)
    return Layout(uv, steps, ["solved"] * cut_mesh.n_charts, notes)


def conformal_pinned(cut_mesh: CutMesh, pins: Pins | None) -> tuple[ComplexArray, BoolArray]:
    """Minimise ½ z* L_C z with at least two fixed vertices in every chart.

    Returns (z (n,), (n_charts,) charts fixed by pins of the user). Raises OptionError for bad pins.
    """
    pinned = np.zeros(cut_mesh.n_charts, bool)
    z = np.zeros(cut_mesh.n_vertices, np.complex128)
    free = np.ones(cut_mesh.n_vertices, bool)
    if pins is not None:
        check_pins(cut_mesh, pins, 2)
        z[pins.vertices], free[pins.vertices] = pins.uv[:, 0] + 1j * pins.uv[:, 1], False
        pinned[cut_mesh.vertex_chart[pins.vertices]] = True
    # others hold two boundary vertices, half a boundary apart, placed a disk's width apart
    outer = outer_boundary(cut_mesh)
    first = outer.start[~pinned]
    second = np.lexsort((np.abs(outer.place - 0.5), outer.index))[first]
    z[outer.vertices[second]] = 2 * np.sqrt(cut_mesh.chart_areas / np.pi)[~pinned]
    free[outer.vertices[np.r_[first, second]]] = False
    system = HeldFactor(conformal_matrix(cut_mesh), ~free)
    return system.solve(np.zeros_like(z), z[~free]), pinned


ROW: MethodRow = Row(
    "lscm",
    lscm,
    "least squares conformal map: angles",
    "Lévy et al. 2002; spectral: Mullen et al. 2008",
    FREE,
    CHECKED,
    frozenset({"lscm", "pins"}),
)
