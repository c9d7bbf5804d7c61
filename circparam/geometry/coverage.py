"""Texels that charts cover: scan conversion from the boundary alone, covered share, and the gaps between
charts.

A chart without flips and overlaps is the inside of its boundary. The covered texels follow from the crossings
of boundary segments with texel rows, at the cost of the boundary, not of the faces. A chart that is folded is
taken apart at its folds: its upright faces and its reversed ones have a boundary each.
"""

import numpy as np

from circparam.core.arrays import cross_areas, next_half_edge, sorted_distinct
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.raster import LabelGrid, free_border, row_crossings, smallest_gap
from circparam.mesh.cut_mesh import CutMesh

LAST_PAGE = 2**52  # float64 has no fractions beyond


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
    lo = np.full((cut_mesh.n_charts, 2), np.inf)
    hi = np.full((cut_mesh.n_charts, 2), -np.inf)
    np.minimum.at(lo, cut_mesh.vertex_chart, uv)
    np.maximum.at(hi, cut_mesh.vertex_chart, uv)
    return lo, hi


def label_grid(
    cut_mesh: CutMesh, uv: FloatArray, resolution: int, charts: BoolArray | None = None
) -> LabelGrid:
    """(resolution, resolution) int32, chart whose inside holds each texel centre, −1 if there is none.

    Row 0 is v = 0. Where charts overlap, the one that begins first in a row is seen. charts: (n_charts,)
    bool, those to draw.
    """
    flat = cut_mesh.faces.ravel()
    q = uv[cut_mesh.faces]
    reversed_faces = cross_areas(q) < 0
    side = reversed_faces[cut_mesh.edges // 3]
    folds = cut_mesh.edges[side[:, 0] != side[:, 1]]
    h = np.concatenate([cut_mesh.boundary, folds.ravel()])
    if charts is not None:
        h = h[charts[cut_mesh.chart[h // 3]]]
    a, b = (uv[flat[k]] * resolution - 0.5 for k in (h, next_half_edge(h)))
    edge, row, x = row_crossings(a, b, resolution, 0.0)
    part = 2 * cut_mesh.chart[h[edge] // 3] + reversed_faces[h[edge] // 3]
    order = np.lexsort((x, row, part))
    x, row, chart = x[order], row[order], part[order] // 2
    # of each chart, a row is inside from its first crossing to its second, and so on
    begin = np.clip(np.ceil(x[0::2]), 0, resolution).astype(np.int64) + row[0::2] * resolution
    end = np.clip(np.floor(x[1::2]) + 1, 0, resolution).astype(np.int64) + row[1::2] * resolution
    # the grid out of runs of texels, counted row after row
    label = chart[0::2]
    order = np.lexsort((end, begin))
    begin, end, label = begin[order], end[order], label[order]
    reached = np.maximum.accumulate(np.r_[0, end])
    begin = np.maximum(begin, reached[:-1])
    end = np.maximum(begin, end)
    length = np.stack([begin - np.r_[0, end[:-1]], end - begin], 1)
    value = np.stack([np.full(len(label), -1, np.int32), label.astype(np.int32)], 1)
    rest = resolution * resolution - int(length.sum())
    drawn = np.repeat(np.append(value, np.int32(-1)), np.append(length, rest))
    return drawn.reshape(resolution, resolution)
