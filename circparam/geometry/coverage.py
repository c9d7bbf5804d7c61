"""Texels that charts cover: scan conversion from the boundary alone, covered share, and the gaps between
charts.

A chart covers a point as often as its boundary winds about the point. The covered texels follow from the
crossings of boundary segments with texel rows, at the cost of the boundary, not of the faces. Reversed faces
are turned over first, so that they count as upright ones do.
"""

import numpy as np

from circparam.core.arrays import cross_areas, group_boxes, next_half_edge, sorted_distinct
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.raster import LabelGrid, free_border, row_crossings, smallest_gap
from circparam.mesh.cut_mesh import CutMesh

LAST_PAGE = 2**52  # float64 has no fractions beyond
# texels: a centre this close to an edge counts as covered; far above the rounding of the check (1e-12), far
# below the distance that matters
EDGE_TEXELS = 1e-6


@dataclass(frozen=True)
class Coverage:
    """Measures of the pages, from a raster.

    share: covered share of the pages, 0..1. gap: smallest distance in texels between the centres of covered
    texels of two charts, infinity beyond the searched distance. border: smallest number of empty texels between
    a covered one and the edge of its page. near: charts (2,) at the smallest gap, or None. pages: how many hold
    a chart.
    """

    share: float
    gap: float
    border: int
    near: tuple[int, int] | None
    pages: int = 1


def cover(
    cut_mesh: CutMesh,
    uv: FloatArray,
    resolution: int,
    search: int,
    charts: BoolArray | None = None,
    stays: BoolArray | None = None,
) -> Coverage:
    """Rasterise every page that holds a chart, and measure it.

    uv: (nv, 2), page p of the pages shown lies at u in [p, p + 1], v in [0, 1]. resolution: texels a side.
    search: the radius in texels up to which gaps are looked for. charts: (n_charts,) charts with uv; None: all.
    stays: (n_charts,) those whose gaps between each other and to the border are nobody's promise.
    """
    page = pages_of(cut_mesh, uv)
    used = np.ones(len(page), bool) if charts is None else charts
    shares, gap, border, near = [], np.inf, resolution, None
    for p in sorted_distinct(page[used]):
        grid = label_grid(cut_mesh, uv - [p, 0], resolution, used & (page == p))
        shares.append(np.count_nonzero(grid >= 0) / grid.size)
        if stays is not None and stays.any():
            old = np.where(grid >= 0, stays[grid], False)
            grid[old] = np.flatnonzero(stays)[0]
            border = min(border, free_border(np.where(old, -1, grid)))
        else:
            border = min(border, free_border(grid))
        here, pair = smallest_gap(grid, search)
        if here < gap:
            gap, near = here, pair
    return Coverage(float(np.mean(shares)), gap, border, near, len(shares))


def pages_of(cut_mesh: CutMesh, uv: FloatArray) -> IntArray:
    """(n_charts,) page of each chart: the unit tile in which the middle of its bounding box lies.

    Left of page 0 is page 0; so far to the right that float64 holds no fractions, all is one page.
    """
    lo, hi = chart_boxes(cut_mesh, uv)
    middle = lo[:, 0] / 2 + hi[:, 0] / 2
    return np.clip(np.floor(middle), 0, LAST_PAGE).astype(np.int64)


def chart_boxes(cut_mesh: CutMesh, uv: FloatArray) -> tuple[FloatArray, FloatArray]:
    """((n_charts, 2) lower, (n_charts, 2) upper corner of the bounding box of each chart); uv (nv, 2)."""
    return group_boxes(uv, cut_mesh.vertex_chart, cut_mesh.n_charts)


def label_grid(
    cut_mesh: CutMesh, uv: FloatArray, resolution: int, charts: BoolArray | None = None
) -> LabelGrid:
    """(resolution, resolution) chart whose inside holds each texel centre, −1 if there is none.

    Row 0 is v = 0. charts: (n_charts,) bool, those to draw.
    """
    flat = cut_mesh.faces.ravel()
    reversed_faces = cross_areas(uv[cut_mesh.faces]) < 0
    side = reversed_faces[cut_mesh.edges // 3]
    folds = cut_mesh.edges[side[:, 0] != side[:, 1]]
    h = np.concatenate([cut_mesh.boundary, folds.ravel()])
    if charts is not None:
        h = h[charts[cut_mesh.chart[h // 3]]]
    a, b = (uv[flat[k]] * resolution for k in (h, next_half_edge(h)))
    turned = reversed_faces[h // 3][:, None]
    return painted(
        np.where(turned, b, a), np.where(turned, a, b), cut_mesh.chart[h // 3], resolution
    )


def painted(start: FloatArray, end: FloatArray, label: IntArray, side: int) -> LabelGrid:
    """(side, side) label of the texels that closed outlines enclose, −1 for the others; row 0 is y = 0.

    start, end: (b, 2) edges in texels. label: (b,); the edges of each label are closed. A centre within
    ``EDGE_TEXELS`` of an edge is covered. Where labels overlap, the one that begins first in a row is seen.
    """
    edge, row, x = row_crossings(start, end, side)
    order = np.lexsort((x, row, label[edge]))
    edge, row, x = edge[order], row[order], x[order]
    # every row of a label is crossed up as often as down, so one sum serves all of them
    winding = np.cumsum(np.where(end[edge, 1] > start[edge, 1], 1, -1))
    inside = np.flatnonzero(winding[:-1])
    # a row is crossed where the upper end lies above: centres at the height of a vertex, and on edges along a
    # row, may be missed
    height = [np.rint(p[:, 1] - 0.5) for p in (start, end)]
    tips = zip((start, end), height, strict=True)
    level = [np.abs(p[:, 1] - 0.5 - h) <= EDGE_TEXELS for p, h in tips]
    along = np.flatnonzero(level[0] & level[1] & (height[0] == height[1]))
    tip = np.flatnonzero(level[0])
    ends = np.stack([start[along, 0], end[along, 0]])
    low = np.concatenate([x[inside], ends.min(0), start[tip, 0]])
    high = np.concatenate([x[inside + 1], ends.max(0), start[tip, 0]])
    rows = np.concatenate([row[inside], height[0][along], height[0][tip]]).astype(np.int64)
    owner = label[np.concatenate([edge[inside], along, tip])]
    first = np.clip(np.ceil(low - 0.5 - EDGE_TEXELS), 0, side).astype(np.int64)
    stop = np.clip(np.floor(high - 0.5 + EDGE_TEXELS) + 1, 0, side).astype(np.int64)
    on = np.flatnonzero((stop > first) & (rows >= 0) & (rows < side))
    begin, stop, owner = (rows * side + first)[on], (rows * side + stop)[on], owner[on]
    # the grid out of runs of texels, counted row after row
    order = np.lexsort((stop, begin))
    begin, stop, owner = begin[order], stop[order], owner[order]
    reached = np.maximum.accumulate(np.r_[0, stop])
    begin = np.maximum(begin, reached[:-1])
    ends = np.stack([begin, np.maximum(begin, stop)], 1).ravel()
    kind = np.int16 if owner.max(initial=0) < np.iinfo(np.int16).max else np.int32
    value = np.full(2 * len(owner) + 1, -1, kind)
    value[1::2] = owner
    return np.repeat(value, np.diff(np.r_[0, ends, side * side])).reshape(side, side)
