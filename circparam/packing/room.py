"""Room on pages that are in use: charts of fixed sizes go where no other chart lies.

All is drawn on a grid of cells, rather too large than too small: a cell that a triangle touches is used. A
chart fits where the correlation of its cells with those in use is zero, which one Fourier transform tells for
all places.
"""

from collections.abc import Sequence

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, ranges
from circparam.core.imports import OnDemand
from circparam.core.records import dataclass
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles

sf = OnDemand("circparam.core.fourier")

# Cells along a page at most: charts get as large on twice as many, to 2 %, in six times the time.
PAGE_CELLS_MOST = 512

# Sizes that are tried, as powers of 2 of the sizes asked for: the least, at which a chart of 64 texels has one;
# and halvings of the interval, which leave 2 % between a size that fits and one that does not.
LEAST_POWER = -6.0
BISECTIONS = 8


@dataclass(frozen=True, eq=False)
class Room:
    """Charts in their places. uv: (nv, 2) in the unit square, u shifted by the page. page: (n,). scale: of the
    sizes asked for."""

    uv: FloatArray
    page: IntArray
    scale: float


def by_page(corners: FloatArray) -> list[FloatArray]:
    """(t, 3, 2) triangles of each page, in its unit square. corners: (m, 3, 2); page k is k to the right."""
    page = np.maximum(np.floor(corners[:, :, 0].mean(1)), 0).astype(np.int64)
    return [corners[page == k] - [k, 0] for k in range(int(page.max(initial=0)) + 1)]


def find_room(
    shapes: Shapes, pages: Sequence[FloatArray], options: PackOptions, exact: bool
) -> Room | None:
    """Places for charts, whose units are pages, on pages in use; None if there are none.

    pages: (t, 3, 2) triangles on each page, in the unit square. exact: at the sizes of the charts; otherwise
    all shrink alike if needed.
    """
    side = min(options.resolution, PAGE_CELLS_MOST)
    grid = _Grid(side, options.resolution / side, options)
    used = [grid.blocked(cells_of(triangles * side, side, side)) for triangles in pages]
    angle = least_box_angles(shapes, options.rotate)
    turns = 1 if options.rotate == "none" else 4
    found = _placed(shapes, grid, used, angle, turns, 1.0)
    if found is not None or exact:
        return found
    low, high = LEAST_POWER, 0.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        got = _placed(shapes, grid, used, angle, turns, 2**middle)
        found, low, high = (found, low, middle) if got is None else (got, middle, high)
    return found or _placed(shapes, grid, used, angle, turns, 2**low)


def free_share(pages: Sequence[FloatArray], options: PackOptions) -> float:
    """Free area in pages, without the gaps round placed charts."""
    side = min(options.resolution, PAGE_CELLS_MOST)
    return float(sum(1.0 - cells_of(t * side, side, side).mean() for t in pages))


@dataclass(frozen=True)
class _Grid:
    """side: cells along the page. texels: of a cell."""

    side: int
    texels: float
    options: PackOptions

    def reach(self) -> BoolArray:
        """Cells round a middle cell with a point nearer than the gap to a point of the middle cell."""
        gap = self.options.gap / self.texels
        k = int(np.ceil(gap))
        apart = np.maximum(np.abs(np.arange(-k, k + 1)) - 1, 0)
        result: BoolArray = np.hypot(apart[:, None], apart) < gap
        return result

    def blocked(self, cells: BoolArray) -> BoolArray:
        """Cells that no chart may touch: those near cells in use, and those at the border."""
        from scipy.ndimage import binary_dilation

        out: BoolArray = binary_dilation(cells, self.reach())
        border = int(np.ceil(self.options.border / self.texels))
        if border:
            out[:border] = out[-border:] = True
            out[:, :border] = out[:, -border:] = True
        return out

    def paint(self, used: BoolArray, cells: BoolArray, row: int, column: int) -> None:
        """Block the cells of a placed chart and its neighbourhood."""
        from scipy.ndimage import binary_dilation

        reach = self.reach()
        k = len(reach) // 2
        near = binary_dilation(np.pad(cells, k), reach)
        top, left = max(row - k, 0), max(column - k, 0)
        h, w = near.shape
        part = used[top : row - k + h, left : column - k + w]
        skip = top - (row - k), left - (column - k)
        part |= near[skip[0] : skip[0] + part.shape[0], skip[1] : skip[1] + part.shape[1]]


@dataclass(frozen=True, eq=False)
class _Piece:
    """One chart on the grid. points: (k, 2) of its vertices, in cells from its box. cells: that it touches."""

    points: FloatArray
    cells: BoolArray

    def turned(self) -> "_Piece":
        """A quarter further, grid and all."""
        x, y = self.points.T
        return _Piece(np.stack([len(self.cells) - y, x], 1), self.cells[::-1].T)


def _placed(
    shapes: Shapes,
    grid: _Grid,
    used: Sequence[BoolArray],
    angle: FloatArray,
    turns: int,
    scale: float,
) -> Room | None:
    """All charts at a scale, the largest first; None if one has no place."""
    world = shapes.place(angle, np.zeros((shapes.n, 2)), scale * grid.side)
    box = shapes.boxes(angle) * scale * grid.side
    size = box[:, 2:] - box[:, :2]
    if (size.max(1) > grid.side).any():
        return None
    pages = [_Page(grid, cells.copy()) for cells in used]
    order = np.argsort(shapes.chart, kind="stable")
    first = np.searchsorted(shapes.chart[order], np.arange(shapes.n + 1))
    uv, page = np.zeros_like(world), np.zeros(shapes.n, np.int64)
    for c in np.argsort(-size.prod(1), kind="stable").tolist():
        faces = shapes.faces[order[first[c] : first[c + 1]]]
        vertices, local = np.unique(faces, return_inverse=True)
        points = world[vertices] - world[vertices].min(0)
        height, width = np.maximum(np.ceil(points.max(0)[::-1] - 1e-9).astype(int), 1)
        cells = cells_of(points[local.reshape(-1, 3)], int(height), int(width))
        pieces = [_Piece(points, cells)]
        for _ in range(turns - 1):
            pieces.append(pieces[-1].turned())
        for number, sheet in enumerate(pages):
            at = sheet.put(pieces)
            if at is not None:
                piece, row, column = at
                uv[vertices] = (piece.points + np.array([column, row])) / grid.side
                uv[vertices, 0] += number
                page[c] = number
                break
        else:
            return None
    return Room(uv, page, scale)


class _Page:
    """The cells of one page that charts may not touch, and their transform."""

    def __init__(self, grid: _Grid, used: BoolArray) -> None:
        self.grid, self.used = grid, used
        self._spectrum: FloatArray | None = None

    def put(self, pieces: Sequence[_Piece]) -> tuple[_Piece, int, int] | None:
        """Place a chart in the lowest of the places of some turns: (piece, row, column); None without room."""
        found = []
        for k, piece in enumerate(pieces):
            h, w = piece.cells.shape
            if max(h, w) > self.grid.side:
                continue
            for row, column in self._free(piece.cells):
                if not (self.used[row : row + h, column : column + w] & piece.cells).any():
                    found.append((row + h, row, column, k))
                    break
        if not found:
            return None
        _, row, column, k = min(found)
        self.grid.paint(self.used, pieces[k].cells, row, column)
        self._spectrum = None
        return pieces[k], row, column

    def _free(self, cells: BoolArray) -> list[tuple[int, int]]:
        """The lowest places at which the correlation is zero, up to rounding."""
        n = self.grid.side
        if self._spectrum is None:
            self._spectrum = sf.rfft2(self.used.astype(np.float32))
        mask = np.zeros((n, n), np.float32)
        mask[: cells.shape[0], : cells.shape[1]] = cells
        hits = sf.irfft2(self._spectrum * np.conj(sf.rfft2(mask)), (n, n))
        return _first(hits[: n - cells.shape[0] + 1, : n - cells.shape[1] + 1] < 0.5)


def _first(free: BoolArray) -> list[tuple[int, int]]:
    """The first eight places that are free, row after row: rounding may be wrong about some."""
    flat = np.flatnonzero(free.ravel())[:8]
    return [divmod(int(k), free.shape[1]) for k in flat]


def cells_of(triangles: FloatArray, height: int, width: int) -> BoolArray:
    """(height, width) bool, row by y: cells that triangles (t, 3, 2), in cells, touch anywhere.

    The slab of every row of cells cuts each triangle that it meets. The covered part of the row is one
    interval, because triangles are convex.
    """
    t = np.asarray(triangles, np.float64).reshape(-1, 3, 2)
    low = np.clip(np.floor(t[:, :, 1].min(1)), 0, height).astype(np.int64)
    high = np.clip(np.floor(t[:, :, 1].max(1)), -1, height - 1).astype(np.int64)
    count = np.maximum(high - low + 1, 0)
    which = np.repeat(np.arange(len(t)), count)
    row = ranges(count) + low[which]
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
    first = np.clip(np.floor(left), 0, width)
    last = np.clip(np.floor(right) + 1, 0, width)
    ok = last > first
    begin = row[ok] * (width + 1) + first[ok].astype(np.int64)
    end = row[ok] * (width + 1) + last[ok].astype(np.int64)
    size = height * (width + 1)
    steps = np.bincount(begin, minlength=size) - np.bincount(end, minlength=size)
    result: BoolArray = np.cumsum(steps.reshape(height, width + 1), 1)[:, :width] > 0
    return result
