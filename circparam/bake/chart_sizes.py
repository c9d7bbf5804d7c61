"""Charts at the density of the images that they show: sharp ones large, blurred ones small, plain ones tiny."""

from __future__ import annotations

import numpy as np

from circparam.bake.look_source import Source
from circparam.core.arrays import FloatArray, IntArray, cross2, group_sum
from circparam.mesh.mesh import UVMap

SPREAD = 16.0  # times the density of the sharpest chart may be that of another: below, little room is won
PLAIN = (
    0.25  # of the least density of charts with images, for those without: they need a few texels
)
PATTERN = 2.0  # times the density of the sharpest image, up to which images that repeat count
TAIL = 0.01  # share of a chart's surface that may be sharper than the chart


def by_density(source: Source, layout: UVMap) -> UVMap:
    """A layout whose charts have sizes in proportion to the density of what they show; they still have to be
    packed.

    layout: of charts with one density, as ``unwrap`` makes them. Images that repeat count up to PATTERN times
    the density of the others.
    """
    chart = layout.charts
    mapped = chart >= 0
    n = int(chart.max()) + 1
    dense = _texels_a_length(source)
    area = _areas(source)
    sharp = _of_charts(dense[mapped], area[mapped], chart[mapped], n)
    shown = sharp > 0
    if not shown.any():
        return layout
    factor = np.maximum(sharp / sharp.max(), 1 / SPREAD)
    factor[~shown] = PLAIN * factor[shown].min()
    size = np.ones(len(layout.uv))
    size[layout.uv_faces[mapped].ravel()] = np.repeat(factor[chart[mapped]], 3)
    return UVMap(layout.uv * size[:, None], layout.uv_faces)


def _areas(source: Source) -> FloatArray:
    """(m,) areas of faces in space."""
    corners = source.document.mesh.points[source.document.mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    out: FloatArray = np.linalg.norm(cross, axis=1) / 2
    return out


def _texels_a_length(source: Source) -> FloatArray:
    """(m,) texels of the densest image of each face along a unit of space; 0 where it shows none."""
    area = _areas(source)
    plain, tiled = np.zeros(len(area)), np.zeros(len(area))
    for k in np.unique(source.looks.face).tolist():
        mine = source.looks.face == k
        for use in source.looks.materials[k].uses.values() if k not in source.kept else ():
            corners = np.nan_to_num(source.in_texels(use))
            side1, side2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
            texels = np.abs(cross2(side1, side2)) / 2
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.nan_to_num(np.sqrt(texels / area), posinf=0.0)
            best = tiled if source.repeats(use, mine) else plain
            some = mine & source.places(use)[1]
            best[some] = np.maximum(best[some], found[some])
    most = PATTERN * plain.max(initial=0) if plain.any() else np.inf
    return np.maximum(plain, np.minimum(tiled, most))


def _of_charts(value: FloatArray, area: FloatArray, chart: IntArray, n: int) -> FloatArray:
    """(n,) the value that all but TAIL of the area of each chart keeps to."""
    order = np.lexsort((value, chart))
    share = np.cumsum(area[order])
    whole = group_sum(area, chart, n)
    before = np.cumsum(whole) - whole
    within = share - before[chart[order]] >= (1 - TAIL) * whole[chart[order]] * (1 - 1e-9)
    first = np.full(n, len(order) - 1)
    np.minimum.at(first, chart[order][within], np.flatnonzero(within))
    out: FloatArray = value[order][first]
    return out
