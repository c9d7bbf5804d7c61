"""Sizes of charts by their images: plain charts tiny, and on request sharp charts large."""

import numpy as np

from circparam.bake.look_source import Source
from circparam.bake.sharpness import PACKED_SHARE_GUESS
from circparam.bake.texels import flat_areas
from circparam.core.arrays import group_sum
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.mesh.mesh import UVMap

LEAST_SIDE_TEXELS = 4.0  # texels a side of a chart without an image, and of the smallest with one
# texels a side for each of its faces, so that numbers of the file tell the faces apart
SIDE_TEXELS_PER_FACE = 0.5
# times the density of the sharpest image, up to which images that repeat count
PATTERN_DENSITY_RATIO = 2.0
SHARPER_AREA_SHARE = 0.01  # share of a chart's surface that may be sharper than the chart


@dataclass(frozen=True, eq=False)
class Sized:
    """layout: charts at new sizes, still to be packed. factor: (m,) that of each face's chart."""

    layout: UVMap
    factor: FloatArray


def chart_sizes(source: Source, layout: UVMap, side: int, even: bool) -> Sized | None:
    """Charts without an image at a few texels; the others at one density, or at that of their images.

    layout: of charts with one density, as ``unwrap`` makes them. side: texels of the page. even: whether charts
    with images keep one density; else images that repeat count up to PATTERN_DENSITY_RATIO times the density of
    the others. None if all charts stay as they are.
    """
    chart = layout.charts
    mapped = chart >= 0
    n = int(chart.max()) + 1
    # texels of the densest image of each face along a unit of space; 0 if it shows none
    area = source.areas
    plain, tiled = np.zeros(len(area)), np.zeros(len(area))
    for k in np.unique(source.looks.face).tolist():
        mine = source.looks.face == k
        for use in source.looks.materials[k].uses.values() if k not in source.kept else ():
            texels = flat_areas(np.nan_to_num(source.in_texels(use)))
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.nan_to_num(np.sqrt(texels / area), posinf=0.0)
            best = tiled if source.repeats(use, mine) else plain
            some = mine & source.places(use)[1]
            best[some] = np.maximum(best[some], found[some])
    most = PATTERN_DENSITY_RATIO * plain.max(initial=0) if plain.any() else np.inf
    dense = np.maximum(plain, np.minimum(tiled, most))
    sharp = _of_charts(dense[mapped], source.areas[mapped], chart[mapped], n)
    shown = sharp > 0
    if not shown.any() or (even and shown.all()):
        return None
    factor = np.ones(n) if even else sharp / sharp.max()
    area = group_sum(flat_areas(layout.uv[layout.uv_faces[mapped]]), chart[mapped], n)
    page = float((area * factor**2)[shown].sum()) / PACKED_SHARE_GUESS
    faces = np.bincount(chart[mapped], minlength=n)
    texels = np.maximum(LEAST_SIDE_TEXELS, SIDE_TEXELS_PER_FACE * np.sqrt(faces))
    least = texels * np.sqrt(page / np.maximum(area, 1e-300)) / side
    factor = np.minimum(np.where(shown, np.maximum(factor, least), least), 1.0)
    size = np.ones(len(layout.uv))
    size[layout.uv_faces[mapped].ravel()] = np.repeat(factor[chart[mapped]], 3)
    return Sized(
        UVMap(layout.uv * size[:, None], layout.uv_faces), np.where(mapped, factor[chart], 1.0)
    )


def _of_charts(value: FloatArray, area: FloatArray, chart: IntArray, n: int) -> FloatArray:
    """(n,) the value that all but SHARPER_AREA_SHARE of the area of each chart keeps to."""
    order = np.lexsort((value, chart))
    share = np.cumsum(area[order])
    whole = group_sum(area, chart, n)
    before = np.cumsum(whole) - whole
    within = share - before[chart[order]] >= (1 - SHARPER_AREA_SHARE) * whole[chart[order]] * (
        1 - 1e-9
    )
    first = np.full(n, len(order) - 1)
    np.minimum.at(first, chart[order][within], np.flatnonzero(within))
    return value[order][first]
