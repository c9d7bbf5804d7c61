"""Least squares conformal maps with a free border (Lévy et al. 2002), spectral (Mullen et al. 2008) or pinned.

The plane is the complex numbers: the conformal energy ½ z* L_C z, Dirichlet energy minus area, has a Hermitian
matrix of one row a vertex, block diagonal over the charts. Nothing guarantees that no face flips.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sps

from circparam.arrays import (
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    group_max,
    group_sum,
    next_half_edge,
)
from circparam.borders import outer_ring
from circparam.errors import OptionError
from circparam.geometry import cotangent_laplacian, signed_areas
from circparam.linear import ComplexFactor
from circparam.mesh import Patches
from circparam.methods.base import Layout, MethodOptions, Pins, check_pins, require_border
from circparam.methods.mend import mend
from circparam.progress import Monitor
from circparam.solve.convex import embed_convex

VARIANTS = ("spectral", "pinned")
MODES = 4  # vectors of the subspace of each chart: eigenvalues come close together on smooth charts
SHIFT = 1e-11  # below the smallest eigenvalue that is not zero, above rounding


def lscm(patches: Patches, options: MethodOptions, monitor: Monitor) -> Layout:
    """The conformal map with a free border; charts are scaled to their area on the surface.

    Spectral without pins, by the option ``lscm`` or where points are pinned the pinned form: a chart without
    pins of the user's then holds two opposite points of its border. Raises OptionError for bad pins.
    """
    if options.lscm not in VARIANTS:
        raise OptionError(f"unknown form of lscm {options.lscm!r}: {' or '.join(VARIANTS)}")
    require_border(patches)
    with monitor.stage("solve"):
        if options.pins is not None or options.lscm == "pinned":
            z, held = conformal_pinned(patches, options.pins)
            steps = np.ones(patches.n_charts, np.int64)
        else:
            z, steps = conformal_spectral(patches, start_modes(patches))
            held = np.zeros(patches.n_charts, bool)
        uv = scaled(patches, np.stack([z.real, z.imag], 1), ~held)
    uv, notes = mend(patches, uv, "lscm", options, monitor)
    return Layout(uv, steps, ["solved"] * patches.n_charts, notes)


def conformal_matrix(patches: Patches) -> sps.csc_matrix:
    """L_C = L + Q, Hermitian positive semidefinite: ½ z* L_C z is the Dirichlet energy minus the area of z.

    Q holds ±i/2 on the border half-edges i → j: half the sum of u_i v_j − u_j v_i is the area inside.
    """
    h = patches.border
    flat = patches.faces.ravel()
    i, j = flat[h], flat[next_half_edge(h)]
    n = patches.n_vertices
    half = np.full(len(h), 0.5j)
    area = sps.coo_matrix(
        (np.concatenate([half, -half]), (np.concatenate([i, j]), np.concatenate([j, i]))),
        shape=(n, n),
    )
    return sps.csc_matrix(cotangent_laplacian(patches) + area.tocsr())


def start_modes(patches: Patches) -> ComplexArray:
    """(n, MODES) powers of a convex map onto the unit disk: near the first modes of a smooth chart."""
    uv, _ = embed_convex(patches, "mean-value")
    z = uv[:, 0] + 1j * uv[:, 1]
    z = z / np.sqrt(patches.chart_areas / np.pi)[patches.vertex_chart]
    return np.stack([z ** (k + 1) for k in range(MODES)], 1)


def conformal_spectral(
    patches: Patches, modes: ComplexArray, limit: int = 60
) -> tuple[ComplexArray, IntArray]:
    """The smallest pair of L_C z = λ B z of every chart, translations taken out; B marks the border vertices.

    Subspace iteration on (L_C + shift B)⁻¹ B with a Rayleigh-Ritz step, all charts in one factorisation; on
    developable charts λ = 0 is the answer, so nothing may skip it: only constants are projected out.
    modes: (n, k) start vectors. Returns (z (n,), steps (n_charts,)).
    """
    matrix = conformal_matrix(patches)
    chart, n = patches.vertex_chart, patches.n_charts
    rim = np.zeros(patches.n_vertices)
    rim[patches.faces.ravel()[patches.border]] = 1.0
    shift = SHIFT * float(np.median(matrix.diagonal().real))
    factor = ComplexFactor(sps.csc_matrix(matrix + sps.diags(shift * rim)))
    rim_count = group_sum(rim, chart, n)
    x = modes.copy()
    steps = np.zeros(n, np.int64)
    open_charts = np.ones(n, bool)
    last_move = np.full(n, np.inf)
    for _ in range(limit):
        before = x[:, 0]
        x = factor.solve_complex(rim[:, None] * x)
        x -= (_chart_sums(rim[:, None] * x, chart, n) / rim_count[:, None])[chart]
        x = _rayleigh_ritz(patches, matrix, rim, x)
        # how far the wanted vector has turned, its free phase taken out
        phase = _chart_sums(rim * before.conj() * x[:, 0], chart, n)
        phase = phase / np.maximum(np.abs(phase), 1e-300)
        x[:, 0] *= phase.conj()[chart]
        move = np.sqrt(group_sum(rim * np.abs(x[:, 0] - before) ** 2, chart, n))
        steps += open_charts
        rounding = (move < 1e-6) & (move > 0.7 * last_move)
        open_charts &= ~((move < 1e-10) | rounding)
        last_move = move
        if not open_charts.any():
            break
    return x[:, 0], steps


def _chart_sums(values: ComplexArray, chart: IntArray, n: int) -> ComplexArray:
    """(n, ...) sum over each chart of complex values (nv, ...)."""
    flat = values.reshape(len(values), -1)
    columns = [
        group_sum(np.ascontiguousarray(c.real), chart, n)
        + 1j * group_sum(np.ascontiguousarray(c.imag), chart, n)
        for c in flat.T
    ]
    return np.stack(columns, 1).reshape(n, *values.shape[1:])


def _rayleigh_ritz(
    patches: Patches, matrix: sps.csc_matrix, rim: FloatArray, x: ComplexArray
) -> ComplexArray:
    """Rotate the subspace of each chart to its B-normalised Ritz vectors, smallest value first."""
    chart, n, k = patches.vertex_chart, patches.n_charts, x.shape[1]
    size = np.sqrt(_chart_sums(rim[:, None] * np.abs(x) ** 2 + 0j, chart, n).real)
    x = x / np.maximum(size, 1e-300)[chart]
    bx = rim[:, None] * x
    gram = _chart_sums(x.conj()[:, :, None] * bx[:, None, :], chart, n)
    weight, basis = np.linalg.eigh(gram)
    # directions that the vectors do not span come back as zero vectors with a huge value
    keep = weight > 1e-12 * weight[:, -1:]
    basis = np.where(keep, 1 / np.sqrt(np.where(keep, weight, 1.0)), 0.0)[:, None, :] * basis
    x = np.einsum("vk,vkl->vl", x, basis[chart])
    energy = _chart_sums(x.conj()[:, :, None] * (matrix @ x)[:, None, :], chart, n)
    big = 1e3 * (1 + np.abs(energy).max((1, 2)))
    energy += np.eye(k) * np.where(keep, 0.0, big[:, None])[:, None, :]
    _, turn = np.linalg.eigh(energy)
    result: ComplexArray = np.einsum("vk,vkl->vl", x, turn[chart])
    return result


def conformal_pinned(patches: Patches, pins: Pins | None) -> tuple[ComplexArray, BoolArray]:
    """Minimise ½ z* L_C z with two or more vertices of every chart held.

    Returns (z (n,), (n_charts,) charts held by pins of the user). Raises OptionError for bad pins.
    """
    held = np.zeros(patches.n_charts, bool)
    vertices = np.zeros(0, np.int64)
    places = np.zeros(0, np.complex128)
    if pins is not None:
        check_pins(patches, pins, 2)
        vertices, places = pins.vertices, pins.uv[:, 0] + 1j * pins.uv[:, 1]
        held[patches.vertex_chart[vertices]] = True
    own, own_places = _opposite_points(patches, ~held)
    vertices = np.concatenate([vertices, own])
    places = np.concatenate([places, own_places])
    free = np.ones(patches.n_vertices, bool)
    free[vertices] = False
    matrix = conformal_matrix(patches).tocsr()
    z = np.zeros(patches.n_vertices, np.complex128)
    z[vertices] = places
    rows = matrix[free]
    z[free] = ComplexFactor(sps.csc_matrix(rows[:, free])).solve_complex(
        -np.asarray(rows[:, ~free] @ z[~free], np.complex128)
    )
    return z, held


def _opposite_points(patches: Patches, charts: BoolArray) -> tuple[IntArray, ComplexArray]:
    """Two border vertices of each of these charts, half a border apart, laid as far apart as a disk is wide."""
    ring = outer_ring(patches)
    first = ring.start[charts]
    distance = np.abs(ring.place - 0.5)
    order = np.lexsort((distance, ring.index))
    second = order[first]
    width = 2 * np.sqrt(patches.chart_areas / np.pi)[charts]
    vertices = np.concatenate([ring.vertices[first], ring.vertices[second]])
    return vertices, np.concatenate([np.zeros(len(first)), width]).astype(np.complex128)


def scaled(patches: Patches, uv: FloatArray, charts: BoolArray) -> FloatArray:
    """uv with these charts centred, turned to a fixed direction, and scaled to their area on the surface.

    Turned so that the outer border's first vertex lies on the positive x axis from the centre.
    """
    z = uv[:, 0] + 1j * uv[:, 1]
    chart, n = patches.vertex_chart, patches.n_charts
    count = np.bincount(chart, minlength=n)
    z = z - (_chart_sums(z, chart, n) / count)[chart]
    size = np.sqrt(group_max(np.abs(z) ** 2, chart, n))
    z = z / np.maximum(size, 1e-300)[chart]
    ring = outer_ring(patches)
    towards = z[ring.vertices[ring.start]]
    far = np.abs(towards) > 1e-12
    z = z * np.where(far, np.conj(towards) / np.where(far, np.abs(towards), 1.0), 1.0)[chart]
    unit = np.stack([z.real, z.imag], 1)
    area = group_sum(np.abs(signed_areas(patches.faces, unit)), patches.chart, n)
    unit *= np.sqrt(patches.chart_areas / np.maximum(area, 1e-300))[chart][:, None]
    return np.where(charts[chart][:, None], unit, uv)
