"""The symmetric Dirichlet energy, its derivatives, the maximal step, and the relaxation of whole charts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.arrays import FloatArray, cross2
from circparam.mesh.cut_mesh import CutMesh, rest_triangles_of
from circparam.solvers import dirichlet
from circparam.solvers.newton import RelaxOptions, System, newton_step, relax
from circparam.solvers.poisson import clamp_stretch, from_jacobians
from circparam.solvers.preconditioner import BlockPattern
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of


def _jacobians(seed: int, count: int = 60) -> FloatArray:
    """Random Jacobians (2, 2, count) with a positive determinant, some of them nearly collapsed."""
    rng = np.random.default_rng(seed)
    j = rng.normal(size=(2, 2, 4 * count))
    j[:, 1, : count // 4] *= 0.05
    return j[:, :, dirichlet.determinants(j) > 1e-2][:, :, :count]


@pytest.mark.parametrize("blend", [0.0, 0.4, 1.0])
def test_the_gradient_is_that_of_the_energy(blend: float) -> None:
    j = _jacobians(1)
    g = dirichlet.gradient(j, blend)
    for d in range(2):
        for c in range(2):
            step = np.zeros_like(j)
            step[d, c] = 1e-6
            slope = (dirichlet.energy(j + step, blend) - dirichlet.energy(j - step, blend)) / 2e-6
            assert np.abs(slope - g[d, c]).max() <= 1e-5 * np.abs(g).max()


@pytest.mark.parametrize("blend", [0.0, 0.4, 1.0])
def test_the_modes_are_the_hessian_without_its_negative_part(blend: float) -> None:
    j = _jacobians(2)
    values, modes = dirichlet.newton_modes(j, blend)
    assert values.min() >= 0
    assembled = np.einsum("km,kabm,kcdm->mabcd", values, modes, modes).reshape(-1, 4, 4)
    hessian = np.zeros((2, 2, 2, 2, j.shape[2]))
    for d in range(2):
        for c in range(2):
            step = np.zeros_like(j)
            step[d, c] = 1e-6
            slope = dirichlet.gradient(j + step, blend) - dirichlet.gradient(j - step, blend)
            hessian[:, :, d, c] = slope / 2e-6
    full = hessian.reshape(4, 4, -1).transpose(2, 0, 1)
    value, vector = np.linalg.eigh((full + full.transpose(0, 2, 1)) / 2)
    positive = np.einsum("mij,mj,mkj->mik", vector, np.maximum(value, 0), vector)
    scale = np.abs(positive).max(axis=(1, 2), keepdims=True)
    assert (np.abs(assembled - positive) / scale).max() < 1e-4


def test_the_proxy_has_the_gradient_of_the_energy_at_its_centre() -> None:
    """SLIM chooses its weights so that W (J − R) is the gradient: that is what makes its step a descent."""
    j = _jacobians(3)
    values, modes = dirichlet.proxy_modes(j)
    (a, b), (c, d) = j
    length = np.hypot(a + d, c - b)
    cosine, sine = (a + d) / length, (c - b) / length
    rotation = np.stack([np.stack([cosine, -sine]), np.stack([sine, cosine])])
    along = np.einsum("kdcm,dcm->km", modes, j - rotation)
    pull = np.einsum("km,km,kdcm->dcm", values, along, modes)
    assert np.allclose(pull, dirichlet.gradient(j), rtol=1e-8, atol=1e-8 * np.abs(pull).max())


@given(st.integers(0, 10_000))
@settings(max_examples=40)
def test_the_largest_step_is_where_a_face_first_collapses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.array([[0.0, 1.0, 0.2], [0.0, 0.1, 1.0]])[:, :, None] + rng.normal(
        scale=0.1, size=(2, 3, 30)
    )
    direction = rng.normal(size=(2, 3, 30))
    t = dirichlet.largest_step(corners, direction)

    def area(s: FloatArray) -> FloatArray:
        p = (corners + s * direction).transpose(2, 1, 0)
        return cross2(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])

    hit = np.isfinite(t)
    assert np.abs(area(np.where(hit, t, 0.0))[hit]).max(initial=0) < 1e-6
    for share in (0.1, 0.5, 0.9, 0.99):
        assert (area(np.where(hit, share * t, share * 50.0)) > 0).all()


@pytest.mark.parametrize(
    ("direction", "expected"),
    [
        ([[0, 0, 0], [0, 0, 0]], np.inf),  # no motion: all coefficients vanish
        ([[1, 1, 1], [2, 2, 2]], np.inf),  # a translation: no linear and no quadratic term
        ([[0, 0, 0], [0, 0, -1]], 1.0),  # linear: corner 2 drops onto the base
        ([[0, -1, 0], [0, 0, -1]], 1.0),  # quadratic with a double root: shrinks to a point
        ([[0, 1, 0], [0, 0, 1]], np.inf),  # grows
        ([[0, 0, 1], [0, 0, 0]], np.inf),  # slides along its base
    ],
)
def test_the_largest_step_on_degenerate_quadratics(
    direction: list[list[float]], expected: float
) -> None:
    corners = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[:, :, None]
    t = dirichlet.largest_step(corners, np.array(direction, float)[:, :, None])
    assert t[0] == pytest.approx(expected) if np.isfinite(expected) else t[0] == np.inf


def _developable(kind: str) -> CutMesh:
    """A strip that can be unrolled: from a cylinder, a cone or a bent sheet."""
    u, v = np.meshgrid(np.linspace(0, 1.2, 25), np.linspace(0, 1, 13))
    if kind == "cylinder":
        p = np.stack([np.cos(2 * u), np.sin(2 * u), v], -1)
    elif kind == "cone":
        r = 0.3 + v
        p = np.stack([r * np.cos(2 * u), r * np.sin(2 * u), 1.5 * r], -1)
    else:
        p = np.stack([u, v, 0 * u], -1)
        p[..., 2] = np.where(u > 0.6, 1.7 * (u - 0.6), 0.0)
    points = p.reshape(-1, 3)
    index = np.arange(points.shape[0]).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return patches_of((points, faces))[0]


@pytest.mark.parametrize("kind", ["cylinder", "cone", "sheet"])
def test_developable_strips_unroll_without_distortion(kind: str) -> None:
    cut_mesh = _developable(kind)
    start, _ = tutte_embedding(cut_mesh, "circle")
    relaxed = relax(cut_mesh, start, RelaxOptions(tolerance=1e-12, max_iterations=200))
    # the triangles of a cone or cylinder are chords: exactly developable between straight rulings
    assert relaxed.energy.max() <= 1 + 1e-6


def test_no_face_is_ever_flipped_from_a_start_with_a_nearly_flat_triangle() -> None:
    cut_mesh = _developable("cylinder")
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
        monkeypatch.setattr("circparam.solvers.newton.DIRECT_LIMIT", 0)
        monkeypatch.setattr("circparam.solvers.newton.SMALL_CHART", 0)
    cut_mesh = _developable("cone")
    uv, _ = tutte_embedding(cut_mesh, "circle")
    fixed = np.zeros(cut_mesh.n_vertices, bool)
    fixed[[5, 40]] = True
    before = relax(cut_mesh, uv, RelaxOptions(max_iterations=0)).energy
    moved = []

    def watched(system: System, u: FloatArray, *more: Any) -> tuple[FloatArray, ...]:
        found = newton_step(system, u, *more)
        moved.append(np.abs(found[0] - u)[fixed].max())
        return found

    monkeypatch.setattr("circparam.solvers.newton.newton_step", watched)
    relaxed = relax(cut_mesh, uv, RelaxOptions(fixed=fixed, max_iterations=50))
    assert np.array_equal(relaxed.uv[fixed], uv[fixed])
    assert max(moved) == 0, "not put back at the end, which may flip faces, but held in every step"
    assert relaxed.energy[0] < 1.01 < before[0]


def test_the_direct_and_the_iterative_solver_reach_the_same_minimum(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cut_mesh = _developable("cylinder")
    start, _ = tutte_embedding(cut_mesh, "circle")
    options = RelaxOptions(tolerance=1e-10, max_iterations=200, blend=0.2)
    direct = relax(cut_mesh, start, options)
    monkeypatch.setattr("circparam.solvers.newton.DIRECT_LIMIT", 0)
    iterative = relax(cut_mesh, start, options)
    assert iterative.energy[0] == pytest.approx(direct.energy[0], rel=1e-7)


def test_the_assembled_matrix_is_symmetric_and_blind_to_translations() -> None:
    cut_mesh = _developable("cone")
    uv, _ = tutte_embedding(cut_mesh, "mean-value")
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jac = dirichlet.jacobians(gradients, uv[cut_mesh.faces].transpose(2, 1, 0))
    blocks = dirichlet.edge_blocks(*dirichlet.newton_modes(jac), gradients)
    matrix = BlockPattern(cut_mesh).assemble(blocks).toarray()
    assert np.allclose(matrix, matrix.T, atol=1e-9 * np.abs(matrix).max())
    shift = np.tile([1.0, 0.0], cut_mesh.n_vertices)
    assert np.abs(matrix @ shift).max() <= 1e-7 * np.abs(matrix).max()


def test_a_poisson_layout_returns_the_layout_its_jacobians_came_from() -> None:
    cut_mesh = _developable("cone")
    uv, _ = tutte_embedding(cut_mesh, "mean-value")
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jac = dirichlet.jacobians(gradients, uv[cut_mesh.faces].transpose(2, 1, 0))
    again, fine = from_jacobians(cut_mesh, jac)
    assert fine.all()
    assert np.allclose(again - again[0], uv - uv[0], atol=1e-9)


@given(st.integers(0, 1000), st.floats(0.1, 0.9))
@settings(max_examples=30)
def test_clamped_jacobians_are_never_flipped(seed: int, low: float) -> None:
    j = np.random.default_rng(seed).normal(size=(2, 2, 50))
    clamped = clamp_stretch(j, low)
    s = np.linalg.svd(clamped.transpose(2, 0, 1), compute_uv=False)
    assert (dirichlet.determinants(clamped) > 0).all()
    assert s.min() >= low * (1 - 1e-9)
    assert s.max() <= (1 + 1e-9) / low


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


def test_weights_move_the_energy_to_the_faces_that_weigh_more() -> None:
    cut_mesh, _ = patches_of(shapes.bumped_disk(300))
    start, _ = tutte_embedding(cut_mesh, "mean-value")
    plain = relax(cut_mesh, start, RelaxOptions(tolerance=1e-9))
    even = relax(
        cut_mesh, start, RelaxOptions(tolerance=1e-9, weight=np.full(len(cut_mesh.chart), 1.0))
    )
    assert np.array_equal(plain.uv, even.uv)

    def energies(uv: FloatArray) -> FloatArray:
        gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
        corners = uv[cut_mesh.faces].transpose(2, 1, 0)
        return dirichlet.energy(dirichlet.jacobians(gradients, corners))

    before = energies(plain.uv)
    worst = before > np.quantile(before, 0.95)
    weight = np.where(worst, 20.0, 1.0)
    heavy = relax(cut_mesh, plain.uv, RelaxOptions(tolerance=1e-9, weight=weight))
    after = energies(heavy.uv)
    assert after[worst].mean() < before[worst].mean() - 1e-3
    share = cut_mesh.areas / cut_mesh.areas.sum()
    assert heavy.energy[0] == pytest.approx((share * weight * after).sum())
    assert (share * weight * after).sum() < (share * weight * before).sum()


def test_weights_stay_with_their_faces_when_other_charts_are_done() -> None:
    flat, bumped = shapes.delaunay_disk(200), shapes.bumped_disk(300)
    alone, _ = patches_of(bumped)
    both, _ = patches_of(shapes.join((flat[0] + [9, 0, 0], flat[1]), bumped))
    rng = np.random.default_rng(3)
    own = rng.uniform(0.2, 5.0, len(alone.chart))
    weight = np.r_[np.ones(len(both.chart) - len(own)), own]
    results = []
    for cut_mesh, w in ((alone, own), (both, weight)):
        start, _ = tutte_embedding(cut_mesh, "mean-value")
        results.append(relax(cut_mesh, start, RelaxOptions(tolerance=1e-12, weight=w)).energy)
    assert results[1][1] == pytest.approx(results[0][0], rel=1e-9)
