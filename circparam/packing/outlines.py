"""Charts as the packers see them: outlines about a centre, extents at any angle."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import cross_areas, group_sum, mask_of, norms2
from circparam.core.graph import components
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.halfedge import boundary_half_edges, shared_edges

_QUARTER = np.pi / 2

# Angles that are tried: of a quarter turn for a box, then finer ones about the best, to 0.03 degrees; of a turn
# for the largest chart of a search. With 90 for boxes pages are equal within 0.2 %; 16 for a search cover 0.6 %
# less. A multiple of four, so that quarters are among them.
ANGLE_STEPS = 24


@dataclass(frozen=True, eq=False)
class Shapes:
    """Charts, each about its own centre, in the units of the uv given.

    faces: (m, 3) into points. points: (nv, 2), relative to the centre of their chart. chart: (m,) 0..n-1.
    owner: (nv,) chart of each vertex, −1 if no face uses it. area: (n,) without sign.
    start, end: (b,) vertices of the outlines' edges, sorted by chart; edge_start: (n + 1,) offsets.
    The winding number of a chart's edges at a point is the number of its faces over the point.
    upright: (n,) bool, charts that are turned by quarters only; None for none.
    """

    faces: IntArray
    points: FloatArray
    chart: IntArray
    owner: IntArray
    area: FloatArray
    start: IntArray
    end: IntArray
    edge_start: IntArray
    upright: BoolArray | None = None

    @property
    def n(self) -> int:
        """Number of charts."""
        return len(self.area)

    @cached_property
    def perimeter(self) -> float:
        """Length of all outlines together."""
        return float(norms2(self.points[self.end] - self.points[self.start]).sum())

    @cached_property
    def radius(self) -> FloatArray:
        """(n,) largest distance of an outline vertex from the centre."""
        r = norms2(self.points[self.start])
        return np.asarray(np.maximum.reduceat(r, self.edge_start[:-1]))

    def boxes(self, angle: FloatArray) -> FloatArray:
        """Bounding boxes of all charts, each turned by its angle: (n,) radians → (n, 4) x0, y0, x1, y1."""
        own, at, px, py = self._corners
        c, s = np.cos(angle), np.sin(angle)
        if px.ndim == 2:  # charts of few corners, one in each column
            x, y = c * px - s * py, s * px + c * py
            return np.stack([x.min(0), y.min(0), x.max(0), y.max(0)], 1)
        c, s = c[own], s[own]
        x, y = c * px - s * py, s * px + c * py
        low, high = np.minimum.reduceat, np.maximum.reduceat
        return np.stack([low(x, at), low(y, at), high(x, at), high(y, at)], 1)

    def sizes(self, angle: FloatArray) -> FloatArray:
        """(n, 2) width and height of the bounding boxes."""
        box = self.boxes(angle)
        return box[:, 2:] - box[:, :2]

    @cached_property
    def _corners(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """(b,) chart, (n,) first, (b,) x and y of the corners of outlines. If no chart has more than a few
        corners k, x and y are (k, n), filled up with the first ones."""
        v, first, count = self.start, self.edge_start[:-1], np.diff(self.edge_start)
        if count.max() <= ANGLE_STEPS:
            k = np.arange(count.max())[:, None]
            v = v[first + np.where(k < count, k, 0)]
        x, y = np.ascontiguousarray(np.moveaxis(self.points[v], -1, 0))
        return self.owner[v], first, x, y

    @cached_property
    def box_angles(self) -> FloatArray:
        """(n,) angle at which the bounding box of each chart has the least area."""
        return self._best_angles(np.multiply)

    @cached_property
    def square_angles(self) -> FloatArray:
        """(n,) angle at which each chart fits the smallest upright square."""
        return self._best_angles(np.maximum)

    def _best_angles(self, cost: np.ufunc) -> FloatArray:
        """Angles of least cost of width and height: a quarter turn in steps, then finer about the best."""
        best = np.zeros(self.n)
        width, count = _QUARTER, ANGLE_STEPS
        for _ in range(4):
            centre, least = best.copy(), np.full(self.n, np.inf)
            for t in np.linspace(-width / 2, width / 2, count):
                size = cost(*self.sizes(centre + t).T)
                better = size < least * (1 - 1e-12)
                best[better], least[better] = (centre + t)[better], size[better]
            width, count = 2 * width / (count - 1), 9
        return best if self.upright is None else np.where(self.upright, 0.0, best)

    def outline(self, c: int) -> tuple[FloatArray, FloatArray]:
        """Edges of the outline of one chart: (k, 2) starts and (k, 2) ends."""
        part = slice(self.edge_start[c], self.edge_start[c + 1])
        return self.points[self.start[part]], self.points[self.end[part]]

    def turned(self, angle: FloatArray, upright: BoolArray) -> "Shapes":
        """The same charts turned by angles (n,) about their centres, some of them upright from now on."""
        points = self.place(angle, np.zeros((self.n, 2)), 1.0)
        return replace(self, points=points, upright=upright)

    def place(self, angle: FloatArray, offset: FloatArray, scale: float) -> FloatArray:
        """(nv, 2): every chart scaled, turned by its angle (n,), its centre moved to offset (n, 2).

        A chart that is not turned keeps its axes exactly. Vertices that no face uses come to the origin.
        """
        own = np.maximum(self.owner, 0)
        c, s = np.cos(angle), np.sin(angle)
        quarter = np.rint(angle / _QUARTER)
        exact = np.abs(angle - quarter * _QUARTER) < 1e-12
        turn = quarter.astype(np.int64) % 4
        c = np.where(exact, np.array([1.0, 0.0, -1.0, 0.0])[turn], c)[own]
        s = np.where(exact, np.array([0.0, 1.0, 0.0, -1.0])[turn], s)[own]
        p = self.points * scale
        out = np.stack([c * p[:, 0] - s * p[:, 1], s * p[:, 0] + c * p[:, 1]], 1) + offset[own]
        out[self.owner < 0] = 0.0
        return out


def shapes_of(faces: IntArray, uv: FloatArray, chart: IntArray) -> Shapes:
    """Charts of a layout: faces (m, 3), uv (nv, 2), chart (m,) labels 0..n-1.

    Raises OptionError if arrays do not fit, uv are not finite, labels leave gaps, or two charts share a uv
    vertex and cannot move apart.
    """
    faces = np.asarray(faces, np.int64)
    uv = np.asarray(uv, np.float64)
    chart = np.asarray(chart, np.int64)
    _validate(faces, uv, chart)
    n = int(chart.max()) + 1
    owner = np.full(len(uv), -1)
    owner[faces.ravel()] = np.repeat(chart, 3)
    shared = np.flatnonzero((owner[faces] != chart[:, None]).any(1))
    if len(shared):
        raise OptionError(
            f"face {shared[0]} shares a uv vertex with another chart: give every chart its own uv vertices"
        )
    start, end = _outline_edges(faces, uv)
    order = np.argsort(owner[start], kind="stable")
    start, end = start[order], end[order]
    edge_start = np.searchsorted(owner[start], np.arange(n + 1)).astype(np.int64)
    at = edge_start[:-1]
    p = uv[start]
    centre = (np.minimum.reduceat(p, at) + np.maximum.reduceat(p, at)) / 2
    points = np.where(owner[:, None] >= 0, uv - centre[np.maximum(owner, 0)], 0.0)
    area = group_sum(np.abs(cross_areas(points[faces])) / 2, chart, n)
    return Shapes(faces, points, chart, owner, area, start, end, edge_start)


def _validate(faces: IntArray, uv: FloatArray, chart: IntArray) -> None:
    if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        raise OptionError(f"faces have shape {faces.shape}: (m, 3) with m > 0 is needed")
    if uv.ndim != 2 or uv.shape[1] != 2:
        raise OptionError(f"uv have shape {uv.shape}: (nv, 2) is needed")
    if chart.shape != (len(faces),):
        raise OptionError(f"chart has shape {chart.shape}: one label a face is needed")
    if faces.min() < 0 or faces.max() >= len(uv):
        raise OptionError(
            f"faces name uv vertices outside 0..{len(uv) - 1}: every corner needs a uv"
        )
    if not np.isfinite(uv[faces]).all():
        raise OptionError("some uv are NaN or infinite: only finite uv can be packed")
    if chart.min() < 0 or (np.bincount(chart) == 0).any():
        raise OptionError("chart labels leave gaps: number the charts 0..n-1")


def _outline_edges(faces: IntArray, uv: FloatArray) -> tuple[IntArray, IntArray]:
    """(b,) vertices at the start and the end of the edges round the faces, reversed ones turned over.

    An edge is left out where two faces lie side by side, and kept twice where they lie over each other. Faces
    that name a vertex twice have no edges. A chart without any edge has all of its faces' instead.
    """
    faces = np.where(cross_areas(uv[faces])[:, None] < 0, faces[:, ::-1], faces)
    a, b = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    whole = np.flatnonzero((faces != faces[:, [1, 2, 0]]).all(1))
    around = boundary_half_edges(len(whole), shared_edges(faces[whole]))
    outline = np.zeros((len(faces), 3), bool)
    outline[whole[around // 3], around % 3] = True
    m, n = len(faces), len(uv)
    count, labels = components(m + n, np.repeat(np.arange(m), 3), faces.ravel() + m)
    vertex = mask_of(n, a[outline.ravel()])
    outline[~mask_of(count, labels[m:][vertex])[labels[:m]]] = True
    h = np.flatnonzero(outline)
    return a[h], b[h]


def least_box_angles(shapes: Shapes, rotate: str) -> FloatArray:
    """(n,) angle of each chart whose bounding box has the least area, then with its long side along u.

    'free' tries ANGLE_STEPS angles of a quarter turn and refines round the best one; '90' only lays the long
    side along u; 'none' turns nothing.
    """
    if rotate == "none":
        return np.zeros(shapes.n)
    best = shapes.box_angles if rotate == "free" else np.zeros(shapes.n)
    width, height = shapes.sizes(best).T
    return best + np.where(height > width * (1 + 1e-9), _QUARTER, 0.0)


def least_square_angles(shapes: Shapes, rotate: str) -> FloatArray:
    """(n,) angle at which each chart fits the smallest upright square."""
    return shapes.square_angles if rotate == "free" else np.zeros(shapes.n)
