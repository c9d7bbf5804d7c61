"""Charts of a group side by side: each group is packed for itself, then its box among the other boxes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, cross2, group_sum
from circparam.core.limits import RESOLUTION
from circparam.core.monitor import Monitor
from circparam.errors import OptionError
from circparam.packing.options import Packed, PackOptions
from circparam.packing.pack import pack

COVERED = 0.5  # share of the pages that charts in boxes cover at first guess
TIGHT = 0.8  # share of its own page that a group covers at first guess
WIDER = 1.06  # times the side of a page on which a group finds no room
ROUNDS = 6  # sizes that are tried
CLOSE = 1.03  # room for more texels that is not worth another round


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Groups packed at one scale. uv: (nv, 2) in texels, each group from 0 on. size: (n, 2) of the boxes."""

    uv: FloatArray
    size: FloatArray


def pack_clusters(
    faces: IntArray,
    uv: FloatArray,
    chart: IntArray,
    group: IntArray,
    options: PackOptions,
    monitor: Monitor,
) -> Packed:
    """Place charts so that those of a group lie in a box that no other group reaches into.

    faces (m, 3) into uv (nv, 2), chart (m,), group (n_charts,) labels 0..k-1. All charts have one scale. Boxes
    are turned by quarters where charts may be turned. Raises OptionError where a fixed scale leaves no room.
    """
    doubled = np.abs(cross2(uv[faces[:, 1]] - uv[faces[:, 0]], uv[faces[:, 2]] - uv[faces[:, 0]]))
    fixed = options.fixed_scale
    scale = fixed or options.resolution * float(
        np.sqrt(2 * COVERED * options.pages / doubled.sum())
    )
    best: tuple[float, FloatArray, IntArray] | None = None
    for _ in range(ROUNDS):
        boxes = _boxes(
            faces, uv, chart, group, replace(options, texel_density=scale, scale=True), monitor
        )
        try:
            placed = _placed(boxes, options, monitor)
        except OptionError:  # a box is larger than a page
            if fixed is not None:
                raise
            scale /= 2
            continue
        more = placed.scale * options.resolution  # times as large as they are packed
        if more >= 1 - 1e-9 and (best is None or scale * more > best[0]):
            best = (scale * more, *_moved(boxes, faces, chart, group, placed))
        if fixed is not None or 1 <= more <= CLOSE:
            break
        scale *= more * 0.995
    if best is None:
        raise OptionError(
            "groups that lie together do not fit on the pages: raise --pages or --resolution, or lower "
            "the density"
        )
    size, places, page = best
    scale = size / options.resolution
    share = group_sum(doubled * scale**2 / 2, page[chart], int(page.max()) + 1)
    return Packed(places, page, scale, share)


def _boxes(
    faces: IntArray,
    uv: FloatArray,
    chart: IntArray,
    group: IntArray,
    options: PackOptions,
    monitor: Monitor,
) -> _Boxes:
    """Each group packed at the density of ``options`` on the smallest page of those tried that holds it."""
    out = np.zeros_like(uv)
    size = np.zeros((int(group.max()) + 1, 2))
    for k in range(len(size)):
        mine = np.flatnonzero(group[chart] == k)
        vertices, local = np.unique(faces[mine], return_inverse=True)
        own = local.reshape(-1, 3)
        charts = np.unique(chart[mine], return_inverse=True)[1].reshape(-1)
        place = _alone(own, uv[vertices], charts, options, monitor)
        low = place.min(0)
        out[vertices], size[k] = place - low, place.max(0) - low
    return _Boxes(out, size)


def _alone(
    faces: IntArray, uv: FloatArray, chart: IntArray, options: PackOptions, monitor: Monitor
) -> FloatArray:
    """(nv, 2) places in texels of the charts of one group."""
    scale = float(options.texel_density or 1.0)
    a, b = (uv[faces[:, k]] - uv[faces[:, 0]] for k in (1, 2))
    area = group_sum(np.abs(cross2(a, b)) / 2, np.zeros(len(faces), np.int64), 1)[0]
    side = float(np.sqrt(area / TIGHT)) * scale + 2 * options.border + options.gap
    while True:
        page = int(np.clip(np.ceil(side), 2 * options.padding + 4, RESOLUTION.high))
        try:
            alone = replace(options, resolution=page, pages=1)
            return pack(faces, uv, chart, alone, monitor).uv * page
        except OptionError:
            if page == RESOLUTION.high:
                raise
        side *= WIDER


def _placed(boxes: _Boxes, options: PackOptions, monitor: Monitor) -> Packed:
    """The boxes packed as rectangles; ``scale`` is from texels to uv."""
    n = len(boxes.size)
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    corners = (boxes.size[:, None] * square).reshape(-1, 2)
    faces = (4 * np.arange(n)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    turn = "none" if options.rotate == "none" else "90"
    fixed = options.fixed_scale is not None
    asked = replace(options, rotate=turn, texel_density=None, scale=not fixed)
    unit = options.resolution if fixed else 1.0
    placed = pack(faces, corners / unit, np.repeat(np.arange(n), 2), asked, monitor)
    return replace(placed, scale=placed.scale / unit)


def _moved(
    boxes: _Boxes,
    faces: IntArray,
    chart: IntArray,
    group: IntArray,
    placed: Packed,
) -> tuple[FloatArray, IntArray]:
    """(uv (nv, 2) of the charts in their boxes as these are placed, page of each chart)."""
    corner = placed.uv.reshape(-1, 4, 2)
    across = (corner[:, 1] - corner[:, 0]) / np.maximum(boxes.size[:, :1], 1e-300)
    up = (corner[:, 3] - corner[:, 0]) / np.maximum(boxes.size[:, 1:], 1e-300)
    of = np.zeros(len(boxes.uv), np.int64)
    of[faces.ravel()] = np.repeat(group[chart], 3)
    x, y = boxes.uv[:, :1], boxes.uv[:, 1:]
    return corner[of, 0] + x * across[of] + y * up[of], placed.page[group]
