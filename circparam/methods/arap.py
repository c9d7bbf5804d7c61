"""As-rigid-as-possible maps (Liu et al. 2008): every face near a rotation of itself. Flips are possible.

Local and global steps lower the energy Σ A ‖J − R‖², R the rotation nearest to J; the global steps share one
factorisation. L-BFGS with that factor as its start matrix then takes over, because it needs far fewer steps
(Liu, Bouaziz, Kavan 2017).
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import group_sum
from circparam.core.linalg import HeldFactor
from circparam.core.monitor import Monitor
from circparam.core.registry import Row
from circparam.core.types import BoolArray, FloatArray
from circparam.geometry.intrinsic import cotangent_laplacian, jacobians
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.base import CHECKED, FREE, Layout, MethodOptions, MethodRow
from circparam.methods.pins import at_pins, check_pins, fit_pins
from circparam.methods.untangled import untangle_layout
from circparam.solvers.lbfgs import DescentOptions, Groups, descend
from circparam.solvers.tutte.embed import require_boundary
from circparam.solvers.tutte.graded import embed_start

ARAP_STEPS = 1000
ARAP_TOLERANCE = 1e-9


def arap(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor) -> Layout:
    """Start from the convex map of the options and minimise the as-rigid-as-possible energy, charts together.

    Pins stay at their places. Raises OptionError for bad pins.
    """
    require_boundary(cut_mesh)
    hold = np.zeros(cut_mesh.n_vertices, bool)
    if options.pins is not None:
        check_pins(cut_mesh, options.pins, 1)
        hold = options.pins.mask(cut_mesh)
    uv, notes = embed_start(cut_mesh, options.start, options.tutte, monitor)
    with monitor.stage("relax"):
        size = np.ones(cut_mesh.n_charts)
        if options.pins is not None:
            uv, size = fit_pins(cut_mesh, uv, options.pins)
        found = descend(
            lambda x: rigid_energy(cut_mesh, x, hold),
            uv,
            Groups(cut_mesh.vertex_chart, cut_mesh.n_charts),
            stiffness(cut_mesh, hold).solve,
            DescentOptions(*options.stops(ARAP_TOLERANCE, ARAP_STEPS)),
            monitor,
        )
    uv, repairs = untangle_layout(
        cut_mesh, found.x, "arap", options, monitor, hold, conformal=False
    )
    uv = at_pins(cut_mesh, uv, size, options.pins)
    return Layout(uv, found.steps, found.reasons, notes + repairs)


def rigid_energy(
    cut_mesh: CutMesh, uv: FloatArray, hold: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """((n_charts,) ½ Σ A ‖J − R‖², its gradient (n_vertices, 2), zero at fixed vertices).

    R is the rotation nearest to J, from the signed singular values: the angle of (a + d, c − b). It does not
    move to first order, so the gradient is that of a linear elastic energy.
    """
    j = jacobians(cut_mesh, uv)
    x, y = j[:, 0, 0] + j[:, 1, 1], j[:, 1, 0] - j[:, 0, 1]
    length = np.hypot(x, y)
    ok = length > 0
    cosine = np.where(ok, x / np.where(ok, length, 1.0), 1.0)
    sine = np.where(ok, y / np.where(ok, length, 1.0), 0.0)
    j[:, 0, 0] -= cosine
    j[:, 1, 1] -= cosine
    j[:, 1, 0] -= sine
    j[:, 0, 1] += sine
    a = cut_mesh.areas
    value = group_sum(a * (j * j).sum((1, 2)), cut_mesh.chart, cut_mesh.n_charts) / 2
    # gradients (m, 2, 3): force on corner k is A (J − R) g_k
    force = np.einsum("mij,mjk->mki", j * a[:, None, None], cut_mesh.gradients).reshape(-1, 2)
    flat = cut_mesh.faces.ravel()
    gradient = group_sum(force, flat, cut_mesh.n_vertices)
    gradient[hold] = 0.0
    return value, gradient


def stiffness(cut_mesh: CutMesh, hold: BoolArray) -> HeldFactor:
    """Factor of the cotangent Laplacian on the vertices that move, with a touch of ridge for translations."""
    L = cotangent_laplacian(cut_mesh)
    d = L.diagonal()
    return HeldFactor(L + sps.diags(1e-9 * d + 1e-14 * float(d.mean())), hold)


ROW: MethodRow = Row(
    "arap",
    arap,
    "as rigid as possible",
    "Liu et al. 2008",
    FREE,
    CHECKED,
    frozenset({"tolerance", "pins"}),
)
