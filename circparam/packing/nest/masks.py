"""Charts as masks on a coarse grid, one for each angle, for the greedy search."""

from functools import cached_property

import numpy as np
import numpy.typing as npt

from circparam.core import clock
from circparam.core.arrays import ranges
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.raster import row_crossings

# Along either axis, how far an outline is grown in units of its radius, by steps −2..2; and the steps of the
# eight directions. Of a radius below half a cell the diagonal ones find the cell in the middle too.
_STEPS = np.array([0.0, np.sqrt(0.5), 1.0, -1.0, -np.sqrt(0.5)])
_GROW = [(2, 0), (1, 1), (0, 2), (-1, 1), (-2, 0), (-1, -1), (0, -2), (1, -1)]


@dataclass(frozen=True, eq=False)
class Masks:
    """Masks of one chart at several angles, all in one block.

    cells: (k, H, W) bool, each mask in the corner of its slice. size: (k, 2) rows and columns in use.
    low: (k, 2) x, y of the block's corner relative to the chart's centre, in cells. angle: (k,) radians.
    """

    cells: BoolArray
    size: IntArray
    low: FloatArray
    angle: FloatArray

    @cached_property
    def area(self) -> npt.NDArray[np.float32]:
        """(k,) number of cells of each mask."""
        return np.asarray(self.cells.sum((1, 2)), np.float32)


def chart_masks(start: FloatArray, end: FloatArray, angle: FloatArray, grow: float) -> Masks:
    """Cells touched by a chart grown by ``grow``: outline edges (e, 2) in cells, angles (k,).

    The inside is filled by winding number, so holes stay free and charts that cross themselves are full.
    """
    clock.tick()  # masks of a hundred charts take half a second
    c, s = np.cos(angle), np.sin(angle)
    a, b = _at_angles(start, c, s), _at_angles(end, c, s)
    low = np.stack([np.floor(x.min(1) - grow - 0.01) for x in a], 1)
    high = np.stack([np.ceil(x.max(1) + grow + 0.01) for x in a], 1)
    size = np.maximum(high - low, 1).astype(np.int64)
    width, height = int(size[:, 0].max()), int(size[:, 1].max())
    a, b = a - low.T[:, :, None], b - low.T[:, :, None]
    cells = _fill(a, b, height, width)
    _touch(cells, a, b, grow)
    return Masks(cells, size[:, ::-1], low, angle)


def _at_angles(p: FloatArray, cosine: FloatArray, sine: FloatArray) -> FloatArray:
    """(2, k, e) x and y of points (e, 2) at each of k angles."""
    c, s = cosine[:, None], sine[:, None]
    return np.stack([c * p[:, 0] - s * p[:, 1], s * p[:, 0] + c * p[:, 1]])


def _fill(a: FloatArray, b: FloatArray, height: int, width: int) -> BoolArray:
    """Cells whose centre has a winding number other than 0: edges (2, k, e)."""
    k = a.shape[1]
    which = np.repeat(np.arange(k), a.shape[2])
    a, b = a.reshape(2, -1).T, b.reshape(2, -1).T
    edge, row, x = row_crossings(a, b, height)
    column = np.clip(np.ceil(x - 0.5).astype(np.int64), 0, width)
    sign = np.where(b[edge, 1] > a[edge, 1], 1, -1)
    flat = (which[edge] * height + row) * (width + 1) + column
    steps = np.bincount(flat, sign, k * height * (width + 1)).reshape(k, height, width + 1)
    return np.asarray(np.rint(np.cumsum(steps, 2))[:, :, :width] != 0)


def _touch(cells: BoolArray, a: FloatArray, b: FloatArray, grow: float) -> None:
    """Set the cells that the outline, grown, runs through: edges (2, k, e)."""
    k, height, width = cells.shape
    d = b[:, 0] - a[:, 0]
    length = np.sqrt(d[0] ** 2 + d[1] ** 2)
    count = np.ceil(length / 0.5).astype(np.int64) + 1
    edge = np.repeat(np.arange(len(length)), count)
    t = (ranges(count) + 0.5) / count[edge]
    px, py = (p[:, edge] * (1 - t) + q[:, edge] * t for p, q in zip(a, b, strict=True))
    radius = grow + 0.12
    column = [_cell(px + radius * x, width) for x in _STEPS]
    row = [_cell(py + radius * y, height) * width for y in _STEPS]
    first = np.arange(k)[:, None] * (height * width)
    flat = cells.reshape(-1)
    for x, y in [*_GROW, (0, 0)] if radius >= 0.5 else _GROW:
        flat[first + row[y] + column[x]] = True


def _cell(p: FloatArray, count: int) -> IntArray:
    """The cells of 0..count − 1 that coordinates lie in, or the nearest; the coordinates are lost."""
    np.floor(p, out=p)
    np.clip(p, 0, count - 1, out=p)
    return p.astype(np.int64)
