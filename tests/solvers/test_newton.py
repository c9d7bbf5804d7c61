"""The symmetric Dirichlet energy, its derivatives, the maximal step, and the relaxation of whole charts."""

import numpy as np
import pytest

from circparam.core.arrays import FloatArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.objective import chart_energies
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of
from tests.support.processes import printed


@pytest.mark.parametrize("refine", [1, 5])
def test_fixed_vertices_stay_and_the_energy_falls(refine: int) -> None:
    """To the last bit, also where so many are solved for by iteration; no face is turned over beside them."""
    cut_mesh, _ = patches_of(shapes.half_cylinder(24 * refine, 12 * refine))
    uv, _ = tutte_embedding(cut_mesh, "circle")
    fixed = np.zeros(cut_mesh.n_vertices, bool)
    fixed[[5, 40]] = True
    before = chart_energies(cut_mesh, uv)
    relaxed = relax(cut_mesh, uv, RelaxOptions(fixed=fixed, max_iterations=50))
    assert np.array_equal(relaxed.uv[fixed], uv[fixed])
    assert (shapes.areas(relaxed.uv[cut_mesh.faces]) > 0).all()
    assert relaxed.energy[0] < 1.01 < before[0]


@pytest.mark.parametrize("refine", [1, 5])
def test_the_direct_and_the_iterative_solver_reach_the_minimum(refine: int) -> None:
    """Up to 3000 vertices the system is factored, beyond it is solved by iteration."""
    cut_mesh, _ = patches_of(shapes.half_cylinder(24 * refine, 12 * refine))
    start, _ = tutte_embedding(cut_mesh, "circle")
    options = RelaxOptions(tolerance=1e-10, max_iterations=200, blend=0.2)
    assert relax(cut_mesh, start, options).energy[0] == pytest.approx(1.0, rel=1e-7)


RELAXED = """
import hashlib
import numpy as np
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.newton import RelaxOptions, relax
from tests.support import shapes
surface = repair(Mesh(*shapes.bumped_disk(4000)))[0]
cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
uv = relax(cut_mesh, tutte_embedding(cut_mesh, "circle")[0], RelaxOptions()).uv
print(hashlib.sha256(uv.tobytes()).hexdigest())
"""


def test_the_same_numbers_whatever_the_number_of_threads() -> None:
    """A chart so large that it is solved by iteration, with sums that a BLAS would share out among threads."""
    one, two = (printed(RELAXED, OMP_NUM_THREADS=n, OPENBLAS_NUM_THREADS=n) for n in "12")
    assert one == two


def mixed_charts() -> tuple[CutMesh, FloatArray]:
    """Three charts: flat and exactly laid out, curved, and curved with a start upside down."""
    disk, curved = shapes.delaunay_disk(60), shapes.bumped_disk(150, height=0.6)
    parts = [disk, (curved[0] + 5, curved[1]), (curved[0] + 10, curved[1])]
    cut_mesh, points = patches_of(shapes.join(*parts))
    uv, _ = tutte_embedding(cut_mesh, "circle")
    chart = cut_mesh.vertex_chart
    uv[chart == 0] = points[chart == 0][:, :2]
    uv[chart == 2] *= [1, -1]
    return cut_mesh, uv


def test_every_chart_stops_for_a_reason_of_its_own() -> None:
    cut_mesh, uv = mixed_charts()
    relaxed = relax(cut_mesh, uv, RelaxOptions(tolerance=1e-8))
    assert relaxed.stopped == ["converged", "converged", "flipped start"]
    assert relaxed.iterations[0] == 1
    assert 2 < relaxed.iterations[1] < 100
    assert relaxed.iterations[2] == 0
    own = cut_mesh.vertex_chart == 2
    np.testing.assert_allclose(relaxed.uv[own], uv[own], rtol=1e-12)
    assert relaxed.energy[2] == np.inf
    np.testing.assert_allclose(chart_energies(cut_mesh, relaxed.uv), relaxed.energy, rtol=1e-9)
    short = relax(cut_mesh, uv, RelaxOptions(tolerance=1e-8, max_iterations=2))
    assert short.stopped == ["converged", "iterations", "flipped start"]
    assert short.iterations.tolist() == [1, 2, 0]


def test_a_chart_stops_at_the_bound_and_not_before() -> None:
    cut_mesh, uv = mixed_charts()
    least = relax(cut_mesh, uv, RelaxOptions(tolerance=1e-10)).energy[1]
    start = chart_energies(cut_mesh, uv)[1]
    bound = float((least + start) / 2)
    relaxed = relax(cut_mesh, uv, RelaxOptions(bound=bound))
    assert relaxed.stopped == ["bound", "bound", "flipped start"]
    assert relaxed.iterations[0] == 0, "it began there"
    assert least < relaxed.energy[1] <= bound
    before = relax(cut_mesh, uv, RelaxOptions(max_iterations=int(relaxed.iterations[1]) - 1))
    assert before.energy[1] > bound
    out_of_reach = relax(cut_mesh, uv, RelaxOptions(bound=float(1 + 0.9 * (least - 1))))
    assert out_of_reach.stopped[1] == "converged"


def test_a_chart_is_given_up_only_where_its_floor_lies_above() -> None:
    cut_mesh, uv = mixed_charts()
    full = relax(cut_mesh, uv, RelaxOptions(tolerance=1e-10))
    least = full.energy[1]
    half = float(1 + 0.5 * (least - 1))
    hopeless = relax(cut_mesh, uv, RelaxOptions(give_up=half))
    assert hopeless.stopped[1] == "gave up"
    assert 1 < hopeless.iterations[1] < full.iterations[1]
    begun = relax(cut_mesh, uv, RelaxOptions(max_iterations=3)).uv
    for early in (False, True):
        again = relax(cut_mesh, begun, RelaxOptions(tolerance=1e-10, give_up=half, early=early))
        assert again.stopped[1] == "gave up"
        assert again.iterations[1] == (1 if early else 2)
    kept = relax(cut_mesh, uv, RelaxOptions(tolerance=1e-10, give_up=float(1.01 * least)))
    assert kept.stopped[1] == "converged"
    assert (full.floor[:2] <= full.energy[:2] * (1 + 1e-12)).all()
    assert full.floor[1] > 1 + 0.9 * (least - 1), "the last steps tell nearly all"


@pytest.mark.parametrize("size", [1e-40, 1e-60, 1e-150])
def test_a_chart_shrunk_to_nothing_leaves_numbers(size: float) -> None:
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(120), 2))
    uv, _ = tutte_embedding(cut_mesh, "circle")
    uv = np.where((cut_mesh.vertex_chart == 1)[:, None], uv * size, uv)
    relaxed = relax(cut_mesh, uv, RelaxOptions(max_iterations=5))
    assert np.isfinite(relaxed.uv).all()
    assert relaxed.energy[0] < chart_energies(cut_mesh, uv)[0]
