"""Isometric maps: a convex map relaxed to the least symmetric Dirichlet energy, never flipping a face."""

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.registry import Row
from circparam.core.types import BoolArray
from circparam.errors import NoResultError, OptionError
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.base import FREE, Layout, MethodOptions, MethodRow
from circparam.methods.pins import at_pins, check_pins, fit_pins
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.tutte.embed import require_boundary
from circparam.solvers.tutte.graded import embed_start
from circparam.solvers.untangle import untangle

ISOMETRIC_TOLERANCE = 1e-6
ISOMETRIC_STEPS = 500


def isometric(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor) -> Layout:
    """Relax the convex map ``options.start`` of all charts together (Smith and Schaefer 2015).

    Free boundary; ``options.blend`` moves the energy from areas to angles; pins hold their places. A face that
    is not flipped at the start never is: every step ends before the first collapse. Raises OptionError for bad
    pins or a blend outside [0, 1], NoResultError if no start without flipped faces is found.
    """
    require_boundary(cut_mesh)
    if not 0 <= options.blend <= 1:
        raise OptionError(f"blend {options.blend} is outside 0 (isometric) .. 1 (conformal)")
    uv, notes = embed_start(cut_mesh, options.start, options.tutte, monitor)
    fixed: BoolArray | None = None
    size = np.ones(cut_mesh.n_charts)
    if options.pins is not None:
        check_pins(cut_mesh, options.pins, 1)
        fixed = options.pins.mask(cut_mesh)
        # the start with the pins in their places, untangled round them, and the sizes of ``fit_pins``
        free = relax(cut_mesh, uv, RelaxOptions(tolerance=1e-3, max_iterations=30), monitor)
        uv, size = fit_pins(cut_mesh, free.uv, options.pins)
        with monitor.stage("unfold"):
            uv, report = untangle(cut_mesh, uv, fixed, monitor)
        if report.after.any():
            chart = int(np.flatnonzero(report.after)[0])
            raise NoResultError(
                f"chart {chart} has {int(report.after[chart])} flipped faces with its pins in place: "
                "move the pins nearer to where the chart lies without them"
            )
    tolerance, limit = options.stops(ISOMETRIC_TOLERANCE, ISOMETRIC_STEPS)
    accuracy = RelaxOptions(tolerance, limit, blend=options.blend, fixed=fixed)
    with monitor.stage("relax"):
        relaxed = relax(cut_mesh, uv, accuracy, monitor)
    stuck = relaxed.stopped.count("flipped start")
    if stuck:
        notes.append(f"isometric: {stuck} charts start with flipped faces and were not relaxed")
    uv = at_pins(cut_mesh, relaxed.uv, size, options.pins)
    return Layout(uv, relaxed.iterations, relaxed.stopped, notes)


ROW: MethodRow = Row(
    "isometric",
    isometric,
    "symmetric Dirichlet energy: angles and areas together",
    "Smith and Schaefer 2015; Smith et al. 2019; Rabinovich et al. 2017",
    FREE | {"flip-free"},
    accepts=frozenset({"start", "blend", "tolerance", "pins"}),
)
