"""The symmetric Dirichlet energy, its derivatives, the maximal step, and the relaxation of whole charts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam.core.arrays import FloatArray, cross2
from circparam.mesh.cut_mesh import rest_triangles_of
from circparam.solvers.newton import Iterate, NewtonStep, RelaxOptions, newton_step, relax
from circparam.solvers.objective import Objective, chart_energies
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support.charts import developable


@pytest.mark.parametrize("kind", ["cylinder", "cone", "sheet"])
def test_developable_strips_unroll_without_distortion(kind: str) -> None:
    cut_mesh = developable(kind)
    start, _ = tutte_embedding(cut_mesh, "circle")
    relaxed = relax(cut_mesh, start, RelaxOptions(tolerance=1e-12, max_iterations=200))
    # the triangles of a cone or cylinder are chords: exactly developable between straight rulings
    assert relaxed.energy.max() <= 1 + 1e-6


def test_no_face_is_ever_flipped_from_a_start_with_a_nearly_flat_triangle() -> None:
    cut_mesh = developable("cylinder")
    plain, _ = tutte_embedding(cut_mesh, "mean-value")
    on_boundary = np.zeros(cut_mesh.n_vertices, bool)
    on_boundary[cut_mesh.faces.ravel()[cut_mesh.boundary]] = True

    def areas(uv: FloatArray) -> FloatArray:
        q = uv[cut_mesh.faces]
        return cross2(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0])

    def compacted(face: int, corner: int) -> FloatArray:
        """The layout with a corner drawn onto the side of its face across from it, all but 1e-9."""
        v, a, b = np.roll(cut_mesh.faces[face], -corner)
        middle = (plain[a] + plain[b]) / 2
        uv = plain.copy()
        uv[v] = middle + 1e-9 * (plain[v] - middle)
        return uv

    trials = (compacted(f, k) for f in range(100, 200) for k in range(3)
              if not on_boundary[cut_mesh.faces[f, k]])  # fmt: skip
    uv = next(trial for trial in trials if (areas(trial) > 0).all())
    assert areas(uv).min() < 1e-7 * areas(plain).min()
    relaxed = relax(cut_mesh, uv, RelaxOptions(max_iterations=100))
    assert (areas(relaxed.uv) > 0).all()
    assert relaxed.energy[0] < 1.001


@pytest.mark.parametrize("direct", [True, False])
def test_fixed_vertices_stay_and_the_energy_falls(
    direct: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last bit, also where the system is solved by iteration and groups of vertices share a step."""
    if not direct:
        monkeypatch.setattr("circparam.solvers.objective.DIRECT_LIMIT", 0)
        monkeypatch.setattr("circparam.solvers.objective.SMALL_CHART", 0)
    cut_mesh = developable("cone")
    uv, _ = tutte_embedding(cut_mesh, "circle")
    fixed = np.zeros(cut_mesh.n_vertices, bool)
    fixed[[5, 40]] = True
    before = chart_energies(cut_mesh, uv)
    moved = []

    def watched(objective: Objective, before: Iterate, *more: Any) -> NewtonStep:
        found = newton_step(objective, before, *more)
        moved.append(np.abs(found.to.uv - before.uv)[fixed].max())
        return found

    monkeypatch.setattr("circparam.solvers.newton.newton_step", watched)
    relaxed = relax(cut_mesh, uv, RelaxOptions(fixed=fixed, max_iterations=50))
    assert np.array_equal(relaxed.uv[fixed], uv[fixed])
    assert max(moved) == 0, "not put back at the end, which may flip faces, but held in every step"
    assert relaxed.energy[0] < 1.01 < before[0]


def test_the_direct_and_the_iterative_solver_reach_the_same_minimum(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cut_mesh = developable("cylinder")
    start, _ = tutte_embedding(cut_mesh, "circle")
    options = RelaxOptions(tolerance=1e-10, max_iterations=200, blend=0.2)
    direct = relax(cut_mesh, start, options)
    monkeypatch.setattr("circparam.solvers.objective.DIRECT_LIMIT", 0)
    iterative = relax(cut_mesh, start, options)
    assert iterative.energy[0] == pytest.approx(direct.energy[0], rel=1e-7)


def test_frames_keep_the_lengths() -> None:
    p = np.random.default_rng(0).normal(size=(50, 3, 3))
    f = rest_triangles_of(p)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        flat = np.linalg.norm(f[:, i] - f[:, j], axis=1)
        assert np.allclose(flat, np.linalg.norm(p[:, i] - p[:, j], axis=1))


RELAXED = """
import hashlib
import numpy as np
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.newton import RelaxOptions, relax
from tests.support import shapes
surface = repair(Mesh(*shapes.bumped_disk(9000)))[0]
cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
uv = relax(cut_mesh, tutte_embedding(cut_mesh, "circle")[0], RelaxOptions()).uv
print(hashlib.sha256(uv.tobytes()).hexdigest())
"""


def test_the_same_numbers_whatever_the_number_of_threads() -> None:
    """A chart so large that it is solved by iteration, with sums that a BLAS would share out among threads."""
    root = Path(__file__).parents[2]
    found = set()
    for threads in ("1", "2"):
        env = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        found.add(subprocess.check_output([sys.executable, "-c", RELAXED], cwd=root, env=env))
    assert len(found) == 1
