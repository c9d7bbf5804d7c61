"""How two layouts fit together: as they are, or bent round each other."""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, group_sum
from circparam.geometry.overlap import SelfContacts
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.hard.unroll import transported
from circparam.solvers import dirichlet
from circparam.solvers.objective import chart_energies
from circparam.solvers.poisson import Poisson, from_jacobians

FEW = 16  # pairs of boundary edges too near each other, up to which charts of hard surfaces are pushed apart
# mean of |J − target|² of the first start, beyond which no other is tried (a collapse has 2): of 1418 unions of
# twelve meshes 85 had more, a twelfth of all faces, and none of them came to anything. None did beyond 0.8, but
# what is given up leaves no lower bound behind, and truck.obj was merged in a worse order then
APART = 0.95
UNTANGLE = 8  # rounds of the Poisson start of unions of hard surfaces; with four fandisk is cut a third longer


def composed(
    cut_mesh: CutMesh, corners: FloatArray, in_right: BoolArray, turn: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Both layouts of each union moved together without any solve.

    corners: (m, 3, 2). in_right: (m,) bool, faces of the part that moves. turn: (n, 2) cosine and sine of its
    rotation.
    Returns ((nv, 2) uv, (n,) energy of it, infinite where faces flip, (n,) energy of both apart, below which no
    layout of the union comes where both are relaxed).
    """
    n = cut_mesh.n_charts
    turn = turn[cut_mesh.chart]
    c, s = turn[:, None, 0], turn[:, None, 1]
    x, y = corners[..., 0], corners[..., 1]
    turned = np.stack([c * x - s * y, s * x + c * y], 2)
    # the mean offset of the vertices that both sides have
    flat = cut_mesh.faces.ravel()
    nv = cut_mesh.n_vertices
    right = np.repeat(in_right, 3)
    left_count = group_sum((~right).astype(float), flat, nv)
    right_count = group_sum(right.astype(float), flat, nv)
    shared = (left_count > 0) & (right_count > 0)
    both = np.flatnonzero(shared)
    moved = np.where(in_right[:, None, None], turned, corners).reshape(-1, 2)
    uv = np.zeros((nv, 2))
    for d in range(2):
        at_left = group_sum(np.where(right, 0.0, moved[:, d]), flat, nv) / np.maximum(left_count, 1)
        at_right = group_sum(np.where(right, moved[:, d], 0.0), flat, nv) / np.maximum(
            right_count, 1
        )
        gap = (at_left - at_right)[both]
        of = cut_mesh.vertex_chart[both]
        shift = group_sum(gap, of, n) / np.maximum(np.bincount(of, minlength=n), 1)
        at_right += shift[cut_mesh.vertex_chart]
        share = left_count / np.maximum(left_count + right_count, 1)
        share = np.where(shared, 0.5, share)
        uv[:, d] = share * at_left + (1 - share) * at_right
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    weight = cut_mesh.areas / cut_mesh.chart_areas[cut_mesh.chart]
    values = []
    for at in (uv[cut_mesh.faces], corners):
        jacobian = dirichlet.jacobians(gradients, at.transpose(2, 1, 0))
        values.append(group_sum(weight * dirichlet.energy(jacobian, 0.0), cut_mesh.chart, n))
    return uv, values[0], values[1]


def hardly_near(contacts: SelfContacts, which: BoolArray, margin: float) -> BoolArray:
    """(n,) bool, charts among some that do not cross themselves and come near themselves in few places.

    Of 272 unions of three hard surfaces that were pushed apart, all 51 that came apart were such.
    """
    out = which & ~contacts.meets
    return out & (contacts.near(margin, out) <= FEW) if out.any() else out


def better_start(
    cut_mesh: CutMesh,
    targets: FloatArray,
    jacobian: FloatArray,
    in_right: BoolArray,
    bound: float,
) -> tuple[FloatArray, FloatArray]:
    """The layout with those Jacobians; where that is far off, its smaller part bends round the larger one.

    Returns ((nv, 2) uv, (n,) energy of it, infinite where faces flip).
    """
    system = Poisson(cut_mesh)
    uv = system.layout(targets)
    first = chart_energies(cut_mesh, uv)
    poor = ~(first <= bound)
    n, chart = cut_mesh.n_charts, cut_mesh.chart
    if poor.any():
        off = ((system.judged(uv)[0] - targets) ** 2).sum((0, 1)) * cut_mesh.areas
        poor &= ~(group_sum(off, chart, n) > APART * cut_mesh.chart_areas)
    if not poor.any():
        return uv, first
    share = group_sum(cut_mesh.areas * in_right, chart, n) / cut_mesh.chart_areas
    moves = np.where((share <= 0.5)[chart], in_right, ~in_right) & poor[chart]
    # charts that are well laid out take no further round of it
    bent = np.where(poor[chart], transported(cut_mesh, jacobian, moves), targets)
    other, _ = from_jacobians(cut_mesh, bent, UNTANGLE, system=system)
    second = chart_energies(cut_mesh, other)
    with np.errstate(invalid="ignore"):
        better = poor & (second < first)
    of_better = better[cut_mesh.vertex_chart]
    uv[of_better] = other[of_better]
    return uv, np.where(better, second, first)
