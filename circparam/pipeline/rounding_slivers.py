"""Slivers of rounding: faces that stay upright in stored numbers and lose most of their width.

A face that is 100 storable numbers long and 3 wide may keep a thousandth of a cell. Its energy then exceeds the
energy of all other faces of its chart. Its vertices move to nearby storable numbers until the symmetric
Dirichlet energy of their faces, measured against the layout before rounding, is least.
"""

import numpy as np

from circparam.core.arrays import cross2, group_sum, mask_of
from circparam.core.types import FloatArray, IntArray
from circparam.pipeline.representable_uv import (
    BOUNDARY_NUMBERS,
    RAY_NUMBERS,
    Patch,
    mixed,
    not_upright,
)

# of the mean energy of its chart: largest share that storing may add to a face. The least room below a
# bound is 5e-6
ENERGY_SHARE = 1e-6
MENDING_ROUNDS = 8  # in each of which every vertex of a sliver moves at most once


def relieve(patch: Patch, stored: FloatArray, chart: IntArray) -> FloatArray:
    """(n, 2) stored places, with the vertices of slivers moved to where those have more of their shape.

    chart: (m,) chart of each face. No face is flipped that was not.
    """
    faces, exact = patch.faces, patch.exact
    load = _loads(exact[faces], stored[faces])
    area = np.abs(cross2(*_sides(exact[faces])))
    most = ENERGY_SHARE * group_sum(area, chart, int(chart.max()) + 1)[chart]
    sliver = (load > most) & np.isfinite(load)
    if not sliver.any():
        return stored
    free = mask_of(len(exact), faces[sliver])
    part, near, v = patch.part(free)
    at, limit = stored[v], np.where(part.on_boundary, BOUNDARY_NUMBERS, RAY_NUMBERS[-1])

    def energy(own: IntArray, around: IntArray, triangles: FloatArray) -> FloatArray:
        """(c, w) load of the faces round vertices at each of their places."""
        load = _loads(part.exact[around][:, None], triangles)
        load[not_upright(triangles)] = np.inf
        return load

    for turn in range(MENDING_ROUNDS):
        load = _loads(part.exact[part.faces], at[part.faces])
        active = mask_of(len(v), part.faces[(load > most[near]) & np.isfinite(load)])
        active &= free[v]
        if not active.any():
            break
        # inner vertices move freely
        waiting = active & ~part.on_boundary if turn % 2 == 0 else active
        for chosen in part.in_turns(waiting, mixed(np.arange(len(v)), turn)):
            along, step = part.rays(at, chosen)
            grid = np.concatenate([at[chosen][:, None], part.places(at, chosen)[0], along], 1)
            cost = part.total(at, chosen, grid, energy)
            away = np.abs(grid - part.start[chosen][:, None]) / step[:, None]
            far = away.max(2) > limit[chosen][:, None]
            far[:, 0] = False
            cost[far] = np.inf
            at[chosen] = grid[np.arange(len(chosen)), cost.argmin(1)]
    out = stored.copy()
    out[v] = at
    return out


def _sides(triangles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two sides of triangles (..., 3, 2)."""
    return triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :]


def _loads(before: FloatArray, after: FloatArray) -> FloatArray:
    """(...) twice the area of triangles (..., 3, 2) times their energy above an isometry. Infinite if one
    of them is not counter-clockwise."""
    a, b = _sides(before)
    c, d = _sides(after)
    was, now = cross2(a, b), cross2(c, d)
    with np.errstate(all="ignore"):
        square = (b * b).sum(-1) * (c * c).sum(-1) + (a * a).sum(-1) * (d * d).sum(-1)
        square = (square - 2 * (a * b).sum(-1) * (c * d).sum(-1)) / (was * was)
        load = was * (square * (1 + (was / now) ** 2) / 4 - 1)
    return np.where((was > 0) & (now > 0) & np.isfinite(load), load, np.inf)
