"""The way through packing: shapes, a placement, uv, and the check on the raster at the end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError, OptionError
from circparam.packing.check import Layout, faults
from circparam.packing.nest.strategy import nested
from circparam.packing.options import Packed, PackOptions
from circparam.packing.outlines import Shapes, shapes_of
from circparam.packing.placement import Placement
from circparam.packing.shelf import shelf_placement
from circparam.packing.skyline import skyline_placement

# Up to this many charts are nested on a grid; from this many on they are also dropped one by one.
NESTED = 250
SKYLINE_FROM = 40

# Below this effort only so few charts are nested: the grid of many costs seconds before any search.
LOOSE = 0.2
FEW_LOOSE = 60


def pack(
    faces: IntArray,
    uv: FloatArray,
    chart: IntArray,
    options: PackOptions | None = None,
    monitor: Monitor | None = None,
) -> Packed:
    """Lay charts on pages: faces (m, 3) into uv (nv, 2), chart (m,) labels 0..n-1.

    All charts get one scale, so relative sizes are kept. Charts are moved, turned as the options allow, and
    scaled, never mirrored. On a raster of the stated resolution the covered texel centres of two charts are
    at least padding + 1 apart and padding texels are empty at the border of the page.

    Raises OptionError where the charts cannot fit (padding, density or sizes too large, too many charts),
    NoResultError where no chart has any extent.
    """
    options = options or PackOptions()
    monitor = monitor or Monitor()
    shapes = shapes_of(faces, uv, chart)
    check_room(shapes, options)
    with monitor.stage("pack"):
        rows = shelf_placement(shapes, options)
        checked: list[tuple[Placement, tuple[Packed, str | None]]] = []

        def check(placement: Placement) -> tuple[Packed, str | None]:
            """What ``finish`` says, once for each placement: it fills a raster of the whole page."""
            for known, answer in checked:
                if known is placement:
                    return answer
            checked.append((placement, finish(shapes, placement, options)))
            return checked[-1][1]

        candidates = _candidates(shapes, options, rows, monitor, lambda p: check(p)[1] is None)
        candidates += [rows] if rows is not None else []
        if not candidates:
            raise OptionError(does_not_fit(shapes, options))
        # the largest scale, then the fewest pages; what the check refuses gives way to the next
        candidates.sort(key=lambda p: (-p.scale, int(p.page.max())))
        for placement in candidates:
            packed, wrong = check(placement)
            if wrong is None:
                return packed
    raise NoResultError(f"packing failed its own check ({wrong}): try a larger --resolution")


def _candidates(
    shapes: Shapes,
    options: PackOptions,
    rows: Placement | None,
    monitor: Monitor,
    sound: Callable[[Placement], bool],
) -> list[Placement]:
    """Placements that are tighter than rows of boxes; none when the time is over."""
    found: list[Placement] = []
    many = FEW_LOOSE if options.effort < LOOSE else NESTED
    dropped = None
    if shapes.n > SKYLINE_FROM and not monitor.expired:
        dropped = skyline_placement(shapes, options, monitor)
    if shapes.n <= many and not monitor.expired:
        found = nested(shapes, options, dropped, rows, monitor, sound)
    if shapes.n <= SKYLINE_FROM and not found and not monitor.expired:
        dropped = skyline_placement(shapes, options, monitor)
    return found + ([dropped] if dropped is not None else [])


def shelf(
    faces: IntArray,
    uv: FloatArray,
    chart: IntArray,
    options: PackOptions | None = None,
    monitor: Monitor | None = None,
) -> Packed:
    """Like ``pack``, by rows of bounding boxes only: coarse, but in no time for any number of charts."""
    options = options or PackOptions()
    shapes = shapes_of(faces, uv, chart)
    check_room(shapes, options)
    placement = shelf_placement(shapes, options)
    if placement is None:
        raise OptionError(does_not_fit(shapes, options))
    packed, wrong = finish(shapes, placement, options)
    if wrong:
        raise NoResultError(f"packing failed its own check: {wrong}; try a larger --resolution")
    return packed


def check_room(shapes: Shapes, options: PackOptions) -> None:
    """Refuse what can never fit: more charts than a page has places, or nothing with any extent."""
    if not shapes.radius.max() > 0:
        raise NoResultError("no chart has any extent in uv: there is nothing to pack")
    side = options.resolution - 2 * options.border
    places = options.pages * (int(side / options.box_gap) + 1) ** 2
    if shapes.n > places:
        raise OptionError(
            f"{shapes.n} charts do not fit: {options.pages} page(s) of {options.resolution} texels have "
            f"{places} places at padding {options.padding}; raise --resolution or --pages, "
            "or lower --padding"
        )


def does_not_fit(shapes: Shapes, options: PackOptions) -> str:
    """The message for charts that do not fit at the scale the user fixed."""
    where = f"{options.pages} page(s) of {options.resolution} texels at padding {options.padding}"
    if options.fixed_scale is None:
        return f"{shapes.n} charts do not fit on {where}: raise --resolution or --pages"
    area = float(shapes.area.sum()) * options.fixed_scale**2 / options.resolution**2
    what = "the sizes given" if not options.scale else f"texel density {options.texel_density:g}"
    return (
        f"{shapes.n} charts at {what} ({area:.2f} pages of area) do not fit on {where}: "
        "lower the density, or raise --resolution or --pages"
    )


def finish(shapes: Shapes, placement: Placement, options: PackOptions) -> tuple[Packed, str | None]:
    """uv of a placement, checked on the raster: returns (packed, what is wrong or None)."""
    local = shapes.place(placement.angle, placement.offset, placement.scale) / options.resolution
    layout = Layout(
        local[shapes.faces],
        shapes.chart,
        local[shapes.start],
        local[shapes.end],
        shapes.owner[shapes.start],
        placement.page,
    )
    wrong, share = faults(layout, options)
    uv = local
    if options.pages > 1:
        uv = local.copy()
        uv[:, 0] += np.where(shapes.owner >= 0, placement.page[np.maximum(shapes.owner, 0)], 0)
    notes = []
    empty = int((shapes.area == 0).sum())
    if empty:
        notes.append(
            f"{empty} of {shapes.n} charts have no area in uv: they are kept as points or lines"
        )
    scale = placement.scale / options.resolution
    return Packed(uv, placement.page, scale, share, notes), wrong
