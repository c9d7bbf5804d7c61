"""The way through packing: shapes, a placement, uv, and the check on the raster at the end."""

from dataclasses import replace
from functools import cache

import numpy as np

from circparam.core import clock
from circparam.core.monitor import Monitor
from circparam.core.types import FloatArray, IntArray
from circparam.errors import NoResultError, OptionError, OutOfTimeError
from circparam.packing import table
from circparam.packing.check import PlacedCharts, faults
from circparam.packing.options import Packed, PackOptions, pages_needed, too_dense
from circparam.packing.outlines import Shapes, least_square_angles, shapes_of
from circparam.packing.placement import PackTask, Placement
from circparam.packing.straight import along_axes

# By which compaction scales nine of ten layouts at most.
COMPACTED = 1.08


def pack(
    faces: IntArray,
    uv: FloatArray,
    chart: IntArray,
    options: PackOptions | None = None,
    monitor: Monitor | None = None,
    least: float = 0.0,
) -> Packed:
    """Place charts on pages: faces (m, 3) into uv (nv, 2), chart (m,) labels 0..n-1.

    least: factor from the uv given to those of a page that is asked for; the search ends early without it.

    All charts get one scale, so relative sizes are kept. Charts are moved, turned as the options allow, and
    scaled, never mirrored. On a raster of the stated resolution the covered texel centres of two charts are at
    least padding + 1 apart. At the border of the page padding texels are empty.

    Raises OptionError if the charts cannot fit (padding, density or sizes too large, too many charts),
    NoResultError if no chart has any extent.
    """
    options = options or PackOptions()
    monitor = monitor or Monitor()
    shapes = shapes_of(faces, uv, chart)
    if options.straighten == "all" and options.rotate == "free":
        shapes = along_axes(shapes)
    check_room(shapes, options)
    check_fixed_room(shapes, options)
    with monitor.stage("pack"):
        # a check fills a raster of the whole page
        checked = cache(lambda placement: finish(shapes, placement, options))
        least *= options.resolution
        task = PackTask(
            shapes, options, monitor, {}, lambda p: checked(p)[1] is None, least / COMPACTED
        )
        candidates = [p for p in _candidates(task) if p.scale >= least]
        if not candidates:
            standing = None if options.scale else _as_they_lie(shapes, uv, options)
            if standing is None:
                raise OptionError(does_not_fit(shapes, options))
            return standing
        # the largest scale, then the fewest pages; the next one follows if the check refuses
        candidates.sort(key=lambda p: (-p.scale, int(p.page.max())))
        for placement in candidates:
            packed, wrong = checked(placement)
            if wrong is None:
                return packed
    raise NoResultError(
        f"packing failed its own check ({wrong}): try another --resolution, or make new charts with "
        "circparam unwrap"
    )


def _candidates(task: PackTask) -> list[Placement]:
    """Placements of all packers that apply, the last row first; tighter ones only while there is time."""
    found: dict[str, Placement] = {}
    for row in table.PACKERS:
        packer, monitor = row.function, task.monitor
        if not packer.instant and (
            monitor.expired or not packer.applies(task.shapes, task.options)
        ):
            continue
        try:
            with clock.bounded(None if packer.instant else monitor.last):
                placement = packer(replace(task, found=dict(found)))
        except OutOfTimeError:
            monitor.late, placement = True, None
        if placement is not None:
            found[row.name] = placement
    return list(reversed(found.values()))


def _as_they_lie(shapes: Shapes, uv: FloatArray, options: PackOptions) -> Packed | None:
    """The layout as given, on one page; None if it fails the check of a page."""
    page = np.zeros(shapes.n, np.int64)
    wrong, share = faults(PlacedCharts.of(shapes, uv, page), options)
    note = "the charts stay where they lie: no other place was found at these sizes"
    return None if wrong is not None else Packed(uv.copy(), page, 1.0, share, [note])


def check_room(shapes: Shapes, options: PackOptions) -> None:
    """Refuse impossible tasks: more charts than a page has places, or charts without extent."""
    if not shapes.radius.max() > 0:
        raise NoResultError("no chart has any extent in uv: there is nothing to pack")
    places = options.pages * (int(options.room / options.box_gap) + 1) ** 2
    if shapes.n > places:
        raise OptionError(
            f"{shapes.n} charts do not fit: {options.pages} page(s) of {options.resolution} texels have "
            f"{places} places at padding {options.padding}; raise --resolution or --pages, "
            "or lower --padding"
        )


def check_fixed_room(shapes: Shapes, options: PackOptions) -> None:
    """Refuse impossible tasks at the scale that the user fixed: too much area, or a chart too long."""
    scale = options.fixed_scale
    if scale is None:
        return
    area = float(shapes.area.sum()) * scale**2
    if pages_needed(area, options) > options.pages:
        raise OptionError(too_dense(area, options))
    side = float(shapes.sizes(least_square_angles(shapes, options.rotate)).max() * scale)
    # the least square is searched in steps: the packers decide on charts slightly too long
    if side > 1.01 * options.room:
        holds = int(np.ceil((side + 2 * options.border) / 100)) * 100  # to a full hundred
        raise OptionError(
            f"the longest chart has {side:.0f} texels, and a page of {options.resolution} has room "
            f"for {options.room:.0f}: lower the density, or raise --resolution to {holds}"
        )


def does_not_fit(shapes: Shapes, options: PackOptions) -> str:
    """The message for charts that do not fit at the scale the user fixed."""
    where = f"{options.pages} page(s) of {options.resolution} texels at padding {options.padding}"
    if options.fixed_scale is None:
        return f"{shapes.n} charts do not fit on {where}: raise --resolution or --pages"
    area = float(shapes.area.sum()) * options.fixed_scale**2 / options.resolution**2
    what, cure = f"texel density {options.texel_density or 0:g}", "lower the density"
    if not options.scale:
        what, cure = "the sizes given", "leave --no-scale out"
    return (
        f"{shapes.n} charts at {what} ({area:.2f} pages of area) do not fit on {where}: "
        f"{cure}, or raise --resolution or --pages"
    )


def finish(shapes: Shapes, placement: Placement, options: PackOptions) -> tuple[Packed, str | None]:
    """uv of a placement, checked on the raster: returns (packed, the fault or None)."""
    local = shapes.place(placement.angle, placement.offset, placement.scale) / options.resolution
    wrong, share = faults(PlacedCharts.of(shapes, local, placement.page), options)
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
