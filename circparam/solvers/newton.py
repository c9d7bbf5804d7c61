"""Relax layouts by projected Newton on the symmetric Dirichlet energy, all charts in one system.

Every chart has its own step length, energy and stopping test; the Hessian is one block matrix. A step stays
below the first collapse of a face (Smith and Schaefer 2015). A layout that starts without a flipped face
therefore ends without one.
"""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, dot2, group_min, group_sum
from circparam.core.clock import tick
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.line_search import backtrack
from circparam.solvers.objective import Objective, in_units_of_faces

SAFETY_SHARE = 0.9  # share of the way to the first collapse that a step may go
BAD_START = 20.0  # energy above which the SLIM proxy converges better than the Hessian
PROXY_STEPS = 4
HOPE_RATIO = 1.2  # a chart is expected to gain at most this many times its last full step
# a full step that gains this many times the prediction is followed by longer ones
STRIDE_RATIO = 1.15
STRIDES = (2.0, 4.0, 8.0)
# the system is rebuilt when the charts that still move have less than this share of its faces
SMALLER_SHARE = 0.8


@dataclass(frozen=True)
class RelaxOptions:
    """Stopping tests, and the vertices that may move.

    tolerance: a chart has converged when the decrease that Newton's model predicts is below this share of its
    energy. max_iterations: bound on the steps. bound: charts whose energy falls to it stop there (None: none
    do). give_up: charts stop if the model predicts that they stay above this energy (None: none do), from the
    second step on; early: from the first step on. fixed: (nv,) bool, vertices that stay where they are. blend:
    share of the conformal energy. weight: (m,) positive factor of the area of each face in the energy (None:
    1); energies are those with the weights then. local: the start has only local errors. A step then takes this
    many iterations of conjugate gradients without a coarse space (None: charts move as a whole).
    """

    tolerance: float = 1e-6
    max_iterations: int = 200
    bound: float | None = None
    give_up: float | None = None
    early: bool = False
    fixed: BoolArray | None = None
    blend: float = 0.0
    weight: FloatArray | None = None
    local: int | None = None


@dataclass(frozen=True, eq=False)
class Relaxed:
    """uv (nv, 2); energy, iterations (n_charts,); stopped: why each chart stopped.

    floor: (n_charts,) estimate of the final energy from below, by the last steps.
    """

    uv: FloatArray
    energy: FloatArray
    floor: FloatArray
    iterations: IntArray
    stopped: list[str]


@dataclass(frozen=True, eq=False)
class Iterate:
    """A layout: uv (nv, 2), the energy (n_charts,) of each chart, the Jacobians (2, 2, m)."""

    uv: FloatArray
    energy: FloatArray
    jacobian: FloatArray


@dataclass(frozen=True, eq=False)
class NewtonStep:
    """to: the layout after the step. predicted (n_charts,): decrease of the energy in Newton's model. length
    (n_charts,): the step as a multiple of Newton's, 0 if none lowers the energy."""

    to: Iterate
    predicted: FloatArray
    length: FloatArray


def relax(
    cut_mesh: CutMesh, uv: FloatArray, options: RelaxOptions, monitor: Monitor | None = None
) -> Relaxed:
    """Minimise the symmetric Dirichlet energy of every chart from a layout without flipped faces.

    uv: (nv, 2) in the units of the mesh. Charts that start with a flipped or collapsed face do not change,
    and their energy is infinite. Source of the steps: Smith and Schaefer (2015); of the eigensystem: Smith,
    Goes and Kim (2019); of the proxy for bad starts: Rabinovich et al. (2017).
    """
    work, start, scale = in_units_of_faces(cut_mesh, uv)
    state = _Relaxation(work, start, options)
    for number in range(options.max_iterations):
        if not state.active.any():
            break
        tick()
        if monitor is not None and monitor.expired:
            state.stopped[state.active] = "time"
            break
        state.step(number)
        if monitor is not None:
            highest = state.energy[np.isfinite(state.energy)].max(initial=0)
            monitor.note(f"energy {highest:.5g}")
    out = state.uv * scale
    if options.fixed is not None:  # to scale and back changes last bits
        out[options.fixed] = uv[options.fixed]
    reasons = [str(s) for s in state.stopped]
    return Relaxed(out, state.energy, state.floor, state.iterations, reasons)


class _Relaxation:
    """The charts during relaxation: layout, energy, floor and reason to stop of each.

    objective, jacobian: of the moving charts; charts, vertices: their numbers in the whole.
    """

    def __init__(self, cut_mesh: CutMesh, uv: FloatArray, options: RelaxOptions) -> None:
        n = cut_mesh.n_charts
        self.options, self.uv = options, uv
        self.iterations = np.zeros(n, np.int64)
        self.stopped = np.full(n, "iterations", dtype=object)
        self.floor = np.ones(n)
        self.weight = options.weight
        self.objective = self._objective(cut_mesh, options.fixed)
        self.energy, self.jacobian = self.objective.energies(self.uv)
        self.stopped[~np.isfinite(self.energy)] = "flipped start"
        self.active = np.isfinite(self.energy)
        if options.bound is not None:
            self.stopped[self.active & (self.energy <= options.bound)] = "bound"
            self.active &= self.energy > options.bound
        self.charts, self.vertices = np.arange(n), np.arange(cut_mesh.n_vertices)

    def _objective(self, cut_mesh: CutMesh, fixed: BoolArray | None) -> Objective:
        """The objective of the active charts; fixed: (nv,) bool of their vertices."""
        objective = Objective(cut_mesh, fixed, self.options.blend, self.weight)
        objective.local = self.options.local
        return objective

    def step(self, number: int) -> None:
        """One step of every active chart; charts that have converged stop."""
        self._narrow()
        inside = self.active[self.charts]
        energy = self.energy[self.charts]
        proxy = bool(number < PROXY_STEPS and energy[inside].max() > BAD_START)
        before = Iterate(self.uv[self.vertices], energy, self.jacobian)
        step = newton_step(self.objective, before, inside, proxy)
        self.jacobian = step.to.jacobian
        self.uv[self.vertices] = step.to.uv
        self.energy[self.charts] = step.to.energy
        self.iterations[self.charts] += inside
        # the floor of each chart, from its last full step; damped steps give no estimate
        after = step.to.energy
        gain = np.where(inside, energy, 0.0) - np.where(inside, after, 0.0)
        expected = np.where(step.length > 0.5, after - HOPE_RATIO * gain, 1.0)
        floor = self.floor[self.charts]
        self.floor[self.charts] = np.where(inside, np.maximum(floor, expected), floor)
        self._stop(step, inside, proxy, first=number == 0)

    def _narrow(self) -> None:
        """Leave out stopped charts if that makes the system clearly smaller."""
        part = self.objective.cut_mesh
        inside = self.active[self.charts]
        if np.count_nonzero(inside[part.chart]) >= SMALLER_SHARE * len(part.faces):
            return
        part, kept, faces = part.subset(inside)
        self.weight = None if self.weight is None else self.weight[faces]
        self.charts, self.vertices = self.charts[inside], self.vertices[kept]
        fixed = None if self.options.fixed is None else self.options.fixed[self.vertices]
        self.objective = self._objective(part, fixed)
        self.energy[self.charts], self.jacobian = self.objective.energies(self.uv[self.vertices])

    def _stop(self, step: NewtonStep, inside: BoolArray, proxy: bool, first: bool) -> None:
        """Stop the charts that have converged, are stuck, are hopeless or have reached the bound; note why."""
        options, energy = self.options, step.to.energy
        going = inside.copy()

        def stop(reason: str, which: BoolArray) -> None:
            self.stopped[self.charts[which & going]] = reason
            going[which] = False

        if not proxy:
            stop("converged", step.predicted <= options.tolerance * energy)
        stop("no descent", step.length <= 0)
        if options.give_up is not None and (options.early or not first):
            stop("gave up", (step.length > 0.5) & (self.floor[self.charts] > options.give_up))
        if options.bound is not None:
            stop("bound", energy <= options.bound)
        self.active[self.charts[inside & ~going]] = False


def newton_step(
    objective: Objective, before: Iterate, active: BoolArray, proxy: bool
) -> NewtonStep:
    """One damped step of every active chart ((n_charts,) bool); the others stay.

    proxy: take the quadratic of SLIM in place of the Hessian. The step ends before a face collapses, and is
    halved until the energy falls by Armijo's rule; a full one may be lengthened (see ``_stride``).
    """
    part, u = objective.cut_mesh, before.uv
    n = part.n_charts
    sound = np.isfinite(before.energy)
    jacobian = np.where(sound[part.chart], before.jacobian, np.eye(2)[:, :, None])
    g = objective.gradient(jacobian, u)
    d = objective.direction(u, jacobian, g, proxy)
    slope = group_sum(dot2(g, d), part.vertex_chart, n)
    bad = ~(slope <= 0)
    if bad.any():  # the model failed (rounding): go down the gradient instead
        d = np.where(bad[part.vertex_chart][:, None], -g, d)
        slope = group_sum(dot2(g, d), part.vertex_chart, n)
    collapse = objective.first_collapse(u, d)
    reach = SAFETY_SHARE * group_min(collapse, part.chart, n)

    def after(t: FloatArray) -> tuple[FloatArray, Iterate]:
        trial = u + t[part.vertex_chart][:, None] * d
        energy, jacobian = objective.energies(trial)
        return energy, Iterate(trial, energy, jacobian)

    t = np.where(active & sound, np.minimum(1.0, reach), 0.0)
    t, (_, to) = backtrack(after, t, before.energy, slope)
    step = NewtonStep(to, -slope / 2, t)
    return step if proxy else _stride(objective, before, d, step, reach)


def _stride(
    objective: Objective, before: Iterate, d: FloatArray, step: NewtonStep, reach: FloatArray
) -> NewtonStep:
    """Longer steps for charts whose full step gains more than the model predicts.

    A nearly collapsed face of width x has the energy 1/x². A Newton step reduces the energy by 7/16, where the
    model predicts 1/3, and widens the face by a third only. Such a start would need dozens of full steps.
    """
    part = objective.cut_mesh
    uv, energy, jacobian, t = step.to.uv, step.to.energy, step.to.jacobian, step.length
    with np.errstate(invalid="ignore"):
        far = (t == 1) & (before.energy - energy > STRIDE_RATIO * step.predicted)
    for length in STRIDES:
        far &= reach >= length
        if not far.any():
            break
        longer = np.where(far, length, t)
        longer_uv = before.uv + longer[part.vertex_chart][:, None] * d
        longer_energy, longer_jacobian = objective.energies(longer_uv)
        with np.errstate(invalid="ignore"):
            far &= longer_energy < energy
        uv = np.where(far[part.vertex_chart][:, None], longer_uv, uv)
        jacobian = np.where(far[part.chart], longer_jacobian, jacobian)
        energy, t = np.where(far, longer_energy, energy), np.where(far, length, t)
    return NewtonStep(Iterate(uv, energy, jacobian), step.predicted, t)
