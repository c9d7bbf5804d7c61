"""Charts of a group side by side: each group is packed for itself, then its box among the other boxes."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import cross_areas, group_sum
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import NoResultError, OptionError
from circparam.packing.options import Packed, PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.pack import check_fixed_room, does_not_fit, finish, pack
from circparam.packing.placement import PackTask
from circparam.packing.shelf import shelf_placement
from circparam.packing.skyline import skyline_placement

# In brackets: the covered share with another value over the share with this one, on four assemblies of 18 to
# 120 parts. First guesses: the share of all pages that charts in boxes cover (0.68: 0.992), and the share of
# its own page that a group covers.
PAGES_SHARE = 0.5
GROUP_SHARE = 0.65

# Scales that are tried (2: 0.970, 8: the same), and the ratio of two that is not worth another (1.1: 0.898).
SCALES_MOST = 4
CLOSE_RATIO = 1.03

# The next scale over the scale for which there is room: groups may pack a little worse there (1: 0.985).
NEXT_SCALE_SHARE = 0.995


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
    are nearly square, or as wide as a page, whichever leaves charts larger. Square boxes are turned by quarters
    if charts may be turned. Raises OptionError if a fixed scale leaves no room.
    """
    charts = _Charts(faces, uv, chart, group)
    found = [_clustered(charts, strips, options, monitor) for strips in (False, True)]
    best = max(found, key=lambda one: -1.0 if one is None else one.scale)
    if best is None:
        raise OptionError(
            "groups that lie together do not fit on the pages: raise --pages or --resolution, or lower "
            "the density"
        )
    return best


@dataclass(frozen=True, eq=False)
class _Charts:
    """faces (m, 3) into uv (nv, 2); chart (m,); group (n_charts,)."""

    faces: IntArray
    uv: FloatArray
    chart: IntArray
    group: IntArray

    @property
    def areas(self) -> FloatArray:
        """(m,) area of each face in the plane."""
        return np.abs(cross_areas(self.uv[self.faces])) / 2


def _clustered(
    charts: _Charts, strips: bool, options: PackOptions, monitor: Monitor
) -> Packed | None:
    """Charts in boxes, at the largest of the scales that are tried; None if none leaves room."""
    fixed = options.fixed_scale
    room = options.resolution * np.sqrt(PAGES_SHARE * options.pages / charts.areas.sum())
    scale, best = float(fixed or room), None
    for _ in range(SCALES_MOST):
        asked = replace(options, texel_density=scale, scale=True)
        try:
            boxes = _boxes(charts, strips, asked, monitor)
            placed = _placed(boxes, options, monitor)
        except (OptionError, NoResultError):  # a group is larger than a page
            if fixed is not None:
                return None
            scale /= 2
            continue
        more = placed.scale * options.resolution  # factor over the packed size
        if more >= 1 - 1e-9 and (best is None or scale * more > best.scale * options.resolution):
            best = _moved(charts, boxes, placed, scale * more / options.resolution)
        # strips fill the width of a page at any scale, so the height left is the measure
        height = (boxes.size[:, 1] + options.gap).sum() / (options.pages * options.resolution)
        larger = float(np.sqrt(1 / height)) if strips and more >= 1 else more
        if fixed is not None or (more >= 1 and larger <= CLOSE_RATIO):
            break
        scale *= larger * NEXT_SCALE_SHARE
    return best


def _boxes(charts: _Charts, strips: bool, options: PackOptions, monitor: Monitor) -> _Boxes:
    """Each group packed at the density of ``options``, on the smallest page that holds it or in a strip."""
    out = np.zeros_like(charts.uv)
    size = np.zeros((int(charts.group.max()) + 1, 2))
    for k in range(len(size)):
        mine = np.flatnonzero(charts.group[charts.chart] == k)
        vertices, local = np.unique(charts.faces[mine], return_inverse=True)
        number = np.unique(charts.chart[mine], return_inverse=True)[1].reshape(-1)
        own = _Charts(local.reshape(-1, 3), charts.uv[vertices], number, charts.group)
        place = _alone(own, strips, options, monitor)
        low = place.min(0)
        out[vertices], size[k] = place - low, place.max(0) - low
    return _Boxes(out, size)


def _alone(charts: _Charts, strip: bool, options: PackOptions, monitor: Monitor) -> FloatArray:
    """(nv, 2) places in texels of the charts of one group."""
    scale = float(options.texel_density or 1.0)
    side = (
        float(np.sqrt(charts.areas.sum() / GROUP_SHARE)) * scale + 2 * options.border + options.gap
    )
    last = options.resolution
    while not strip:
        page = int(np.clip(np.ceil(side), 2 * options.padding + 4, last))
        try:
            alone = replace(options, resolution=page, pages=1)
            return pack(charts.faces, charts.uv, charts.chart, alone, monitor).uv * page
        except (OptionError, NoResultError):  # too small, or refused by the check
            if page == last:
                raise
        side *= CLOSE_RATIO
    # the skyline fills a page from below, so on a whole one charts make a strip
    shapes, whole = shapes_of(charts.faces, charts.uv, charts.chart), replace(options, pages=1)
    check_fixed_room(shapes, whole)
    for packer in (skyline_placement, shelf_placement):
        placement = packer(PackTask(shapes, whole, monitor))
        if placement is not None:
            packed, wrong = finish(shapes, placement, whole)
            if wrong is None:
                return packed.uv * last
    raise OptionError(does_not_fit(shapes, whole))


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


def _moved(charts: _Charts, boxes: _Boxes, placed: Packed, scale: float) -> Packed:
    """The charts in their boxes as these are placed. scale: from the uv given to those of a page."""
    corner = placed.uv.reshape(-1, 4, 2)
    across = (corner[:, 1] - corner[:, 0]) / np.maximum(boxes.size[:, :1], 1e-300)
    up = (corner[:, 3] - corner[:, 0]) / np.maximum(boxes.size[:, 1:], 1e-300)
    of = np.zeros(len(boxes.uv), np.int64)
    of[charts.faces.ravel()] = np.repeat(charts.group[charts.chart], 3)
    x, y = boxes.uv[:, :1], boxes.uv[:, 1:]
    uv = corner[of, 0] + x * across[of] + y * up[of]
    page = placed.page[charts.group]
    share = group_sum(charts.areas * scale**2, page[charts.chart], int(page.max()) + 1)
    return Packed(uv, page, scale, share)
