"""Room on a page that is in use: new charts go where no other chart lies. Plain NumPy, nothing of Blender.

Everything is drawn conservatively on a grid of SIDE × SIDE cells, so a free cell is free to its edges. A chart
fits where the correlation of its cells with those in use is zero, which one Fourier transform tells everywhere.
"""

import numpy as np

SIDE = 256  # cells along a page: 8 texels of a page of 2048
SMALLEST = 1 / 64  # of the density asked for: charts smaller than this are no layout
HALVINGS = 7  # of the ratio between a size that fits and one that does not: to 3 %


def cells_of(triangles, side=SIDE):
    """(side, side) bool, row by v: cells of the unit page that triangles (t, 3, 2) touch anywhere.

    Each triangle is cut by the slab of every row of cells that it reaches; what it covers of that row is one
    interval, since triangles are convex.
    """
    t = np.asarray(triangles, np.float64).reshape(-1, 3, 2) * side
    low = np.clip(np.floor(t[:, :, 1].min(1)), 0, side).astype(int)
    high = np.clip(np.floor(t[:, :, 1].max(1)), -1, side - 1).astype(int)
    count = np.maximum(high - low + 1, 0)
    which = np.repeat(np.arange(len(t)), count)
    row = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + low[which]
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for k in range(3):
        a, b = t[which, k], t[which, (k + 1) % 3]
        rise = b[:, 1] - a[:, 1]
        meets = (np.minimum(a[:, 1], b[:, 1]) <= row + 1) & (np.maximum(a[:, 1], b[:, 1]) >= row)
        for y, x in ((a[:, 1], a[:, 0]), (b[:, 1], b[:, 0])):
            inside = np.clip(y, row, row + 1)
            share = np.divide(inside - y, rise, out=np.zeros_like(rise), where=rise != 0)
            at = x + share * (b[:, 0] - a[:, 0])
            left = np.where(meets, np.minimum(left, at), left)
            right = np.where(meets, np.maximum(right, at), right)
    first = np.clip(np.floor(left), 0, side)
    last = np.clip(np.floor(right) + 1, 0, side)
    ok = last > first
    edge = np.zeros((side, side + 1), np.int64)
    np.add.at(edge, (row[ok], first[ok].astype(int)), 1)
    np.add.at(edge, (row[ok], last[ok].astype(int)), -1)
    return np.cumsum(edge, 1)[:, :side] > 0


def grown(cells, by):
    """Cells and all that lie within ``by`` cells of them, along both axes."""
    out = cells.copy()
    for axis in (0, 1):
        reach = out.copy()
        for k in range(1, by + 1):
            for step in (k, -k):
                moved = np.roll(out, step, axis)
                edge = [slice(None), slice(None)]
                edge[axis] = slice(0, step) if step > 0 else slice(step, None)
                moved[tuple(edge)] = False
                reach |= moved
        out = reach
    return out


def find_room(charts, used, size, padding, exact=False):
    """Where charts go: [(scale, shift (2,), quarter turns)], one for each, all of one scale; None without room.

    charts: triangles (t, 3, 2) of each chart. used: triangles (u, 3, 2) that stay. size: the scale that
    is wanted; a smaller one is taken where that does not fit, unless ``exact``. padding: in uv units.
    """
    gap = int(np.ceil(padding * SIDE - 1e-9))
    taken = grown(cells_of(used), gap)
    low, high = SMALLEST * size, size
    best = _place(charts, taken, high, gap)
    if best is not None or exact:
        return best
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        got = _place(charts, taken, middle, gap)
        best, low, high = (best, low, middle) if got is None else (got, middle, high)
    return best or _place(charts, taken, low, gap)


def _place(charts, taken, scale, gap):
    """The largest chart first, each in the lowest place of two quarter turns; None where one has none."""
    span = [np.ptp(c.reshape(-1, 2), axis=0) * scale * SIDE for c in charts]
    if any(s.max() + 2 * gap > SIDE for s in span):
        return None
    taken, out = taken.copy(), [None] * len(charts)
    for k in np.argsort([-float(np.prod(s)) for s in span], kind="stable"):
        waves = np.fft.rfft2(taken)
        found = []
        for turn in (0, 1):
            at = turned(charts[k], turn) * scale
            corner = at.reshape(-1, 2).min(0)
            cells = cells_of(at - corner)
            height, width = (np.flatnonzero(cells.any(axis)).max() + 1 for axis in (1, 0))
            hits = np.fft.irfft2(waves * np.conj(np.fft.rfft2(cells)), cells.shape)
            free = hits[gap : SIDE - height - gap + 1, gap : SIDE - width - gap + 1] < 0.5
            if free.any():
                row, column = np.argwhere(free)[0] + gap
                found.append((row + height, row, column, turn, cells, corner))
        if not found:
            return None
        _, row, column, turn, cells, corner = min(found, key=lambda f: f[:4])
        taken |= grown(np.roll(cells, (row, column), (0, 1)), gap)
        out[k] = (scale, np.array([column, row]) / SIDE - corner, turn)
    return out


def turned(points, turns):
    """Points (..., 2) turned by so many quarters about the origin."""
    for _ in range(turns):
        points = np.stack([-points[..., 1], points[..., 0]], -1)
    return points
