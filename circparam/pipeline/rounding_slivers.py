"""Slivers of rounding: faces that stay upright in stored numbers and lose most of their width.

A face that is 100 storable numbers long and 3 wide may keep a thousandth of a cell. Its energy then exceeds the
energy of all other faces of its chart. Its vertices move to nearby storable numbers until the symmetric
Dirichlet energy of their faces, measured against the layout before rounding, is least.
"""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2, group_sum
from circparam.geometry.predicates import orientation
from circparam.pipeline.representable_uv import (
    FAR_ON_BOUNDARY,
    RADII,
    Rounding,
    independent,
    places,
    rays,
)

# of the mean energy of its chart: largest share that storing may add to a face The least room below a bound
# is 5e-6
ENERGY_SHARE = 1e-6
ROUNDS = 8  # in each of which every vertex of a sliver moves at most once


def relieve(
    faces: IntArray,
    exact: FloatArray,
    stored: FloatArray,
    on_boundary: BoolArray,
    chart: IntArray,
    rounding: Rounding,
) -> FloatArray:
    """(nv, 2) stored places, with the vertices of slivers moved to where those have more of their shape.

    faces: (m, 3), counter-clockwise as they should lie. exact: (nv, 2) before rounding. on_boundary: (nv,)
    bool: such vertices move by ``FAR_ON_BOUNDARY`` numbers at most. chart: (m,) chart of each face. No face is
    flipped that was not.
    """
    load = _loads(exact[faces], stored[faces])
    area = np.abs(cross2(*_sides(exact[faces])))
    most = ENERGY_SHARE * group_sum(area, chart, int(chart.max()) + 1)[chart]
    sliver = (load > most) & np.isfinite(load)
    if not sliver.any():
        return stored
    free = np.zeros(len(exact), bool)
    free[faces[sliver]] = True
    near = np.flatnonzero(free[faces].any(1))
    v, local = np.unique(faces[near], return_inverse=True)
    patch, at = local.reshape(-1, 3), stored[v]
    start, limit = rounding(exact[v]), np.where(on_boundary[v], FAR_ON_BOUNDARY, RADII[-1])
    for turn in range(ROUNDS):
        load = _loads(exact[v][patch], at[patch])
        active = np.zeros(len(v), bool)
        active[patch[(load > most[near]) & np.isfinite(load)]] = True
        active &= free[v]
        if not active.any():
            break
        # inner vertices move freely
        waiting = active & ~on_boundary[v] if turn % 2 == 0 else active
        while waiting.any():
            chosen = independent(patch, waiting, turn)
            waiting[chosen] = False
            at[chosen] = _best(patch, exact[v], at, chosen, (start, limit), rounding)
    out = stored.copy()
    out[v] = at
    return out


def _best(
    faces: IntArray,
    exact: FloatArray,
    x: FloatArray,
    chosen: IntArray,
    bounds: tuple[FloatArray, IntArray],
    rounding: Rounding,
) -> FloatArray:
    """(k, 2) the place round each chosen vertex with the least load; bounds: (start, limit)."""
    start, limit = bounds
    along, step = rays(faces, x, chosen, rounding)
    grid = np.concatenate([x[chosen][:, None], places(x[chosen], rounding)[0], along], 1)
    away = np.abs(grid - start[chosen][:, None]) / step[:, None]
    cost = np.where(away.max(2) <= limit[chosen][:, None], 0.0, np.inf)
    cost[:, 0] = 0.0
    slot = np.full(len(x), -1)
    slot[chosen] = np.arange(len(chosen))
    corner = np.flatnonzero(slot[faces.ravel()] >= 0)
    own = slot[faces.ravel()[corner]]
    turned = faces[corner // 3][
        np.arange(len(corner))[:, None], (corner[:, None] + np.arange(3)) % 3
    ]
    w = grid.shape[1]
    now = np.repeat(x[turned][:, None], w, axis=1)
    now[:, :, 0] = grid[own]
    load = _loads(exact[turned][:, None], now)
    low = orientation(*(now.reshape(-1, 3, 2)[:, k] for k in range(3))) <= 0
    load[low.reshape(load.shape)] = np.inf
    np.add.at(cost, own, load)
    result: FloatArray = grid[np.arange(len(chosen)), cost.argmin(1)]
    return result


def _sides(triangles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two sides of triangles (..., 3, 2)."""
    return triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :]


def _loads(before: FloatArray, after: FloatArray) -> FloatArray:
    """(...) twice the area of triangles (..., 3, 2) times their energy above an isometry.

    Infinite if one of them is not counter-clockwise.
    """
    a, b = _sides(before)
    c, d = _sides(after)
    was, now = cross2(a, b), cross2(c, d)
    with np.errstate(all="ignore"):
        square = (b * b).sum(-1) * (c * c).sum(-1) + (a * a).sum(-1) * (d * d).sum(-1)
        square = (square - 2 * (a * b).sum(-1) * (c * d).sum(-1)) / (was * was)
        load = was * (square * (1 + (was / now) ** 2) / 4 - 1)
    return np.where((was > 0) & (now > 0) & np.isfinite(load), load, np.inf)
