"""Nesting from end to end: a search on a coarse grid, then the best layouts compacted until they lock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from circparam.core.monitor import Monitor
from circparam.packing.budget import Work
from circparam.packing.nest.compaction import compact
from circparam.packing.nest.search import (
    Found,
    cell_size,
    chart_angles,
    lay_first,
    make_board,
    search,
    to_placement,
)
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_square_angles
from circparam.packing.placement import Placement

# Share of the page that is hoped for: it sets the size of the grid.
_HOPE = 0.68

# Cells that are transformed in the search, on a coarse grid and on others: a second or so.
_COARSE_BUDGET = 0.3e8
_BUDGET = 0.75e8

# Linear programs of the compaction: first for every candidate, then for the best.
_ROUGH = 5
_FINE = 12

# Side of the grid in cells: coarse for few charts, whose layouts are compacted anyway (on 13 files 64 cells
# cover 0.605 of the page in the mean, 128 cells 0.596 with more than twice the cells transformed).
_FEW = 60
_COARSE = 64
_CELLS = 192

# Rows of the linear programs altogether: beyond, the steps end.
_ROWS = 250_000

# Layouts that are compacted, of so many charts; one of more.
_VERY_FEW = 30
_KEPT = 3

# Rounds of the search for the angle of a single chart: each is four times finer.
_ALONE = 8

# Many charts in plain rows are compacted only where that much more than their scale was not reached.
_ROWS_BELOW = 1.03

# Charts up to which linear programs are solved in a second or so.
_SQUEEZED = 150


def nested(
    shapes: Shapes,
    options: PackOptions,
    dropped: Placement | None,
    rows: Placement | None,
    monitor: Monitor,
    sound: Callable[[Placement], bool],
) -> list[Placement]:
    """Placements by nesting, best first; empty where the search found none.

    dropped: charts dropped one by one, compacted instead of the layout found, or beside it, where there are
    few charts. rows: a plain layout, compacted too where that leads nowhere: for charts like boxes it can be
    the best start.
    sound: the check on the raster. A long first step may push a thin tip through a neighbour, which no later
    step undoes; then the next layout is taken.
    """
    if options.fixed_scale is not None:
        return _at_fixed_scale(shapes, options, options.fixed_scale, monitor)
    if shapes.n == 1:
        return [_alone(shapes, options)]
    layouts = _layouts(shapes, options, monitor)
    if shapes.n > _SQUEEZED:
        return layouts[:1]
    few = shapes.n <= _FEW
    part = min(1.0, 4 * options.effort)
    work = Work(_ROWS * max(part, 0.25), lambda: monitor.expired)
    rough: list[Placement] = []
    starts = layouts[: _KEPT if shapes.n <= _VERY_FEW else 1] + ([dropped] if dropped else [])
    if not few:
        starts = sorted(starts, key=lambda p: -p.scale)[:1]
    for layout in [*starts, rows]:
        if layout is None or work.late or (rough and work.left < _ROWS / 3):
            continue
        if layout is rows and not few and rough and rough[0].scale > _ROWS_BELOW * rows.scale:
            continue
        rough.append(compact(shapes, layout, options, _steps(_ROUGH, part), work))
    rough.sort(key=lambda p: -p.scale)
    steps = _steps(_FINE if few else _FINE // 2, part)
    for start in rough:
        fine = compact(shapes, start, options, steps, work, 8.0)
        if sound(fine):
            return [fine]
        # the straight strips were too narrow somewhere: the full gap everywhere may do
        safe = compact(shapes, fine, options, 3, work, 1.0, strict=True)
        if sound(safe):
            return [safe]
    return layouts[:1]


def _alone(shapes: Shapes, options: PackOptions) -> Placement:
    """One chart in the middle of its page, at the angle where it fits the smallest square."""
    angle = least_square_angles(shapes, options.rotate, rounds=_ALONE)
    box = shapes.boxes(angle)
    side = float((box[:, 2:] - box[:, :2]).max())
    scale = (options.resolution - 2 * options.border) / side
    middle = (box[:, 2:] + box[:, :2]) / 2
    offset = options.resolution / 2 - middle * scale
    return Placement(scale, angle, offset, np.zeros(1, np.int64))


def _steps(most: int, part: float) -> int:
    return max(2, round(most * part))


def _layouts(shapes: Shapes, options: PackOptions, monitor: Monitor) -> list[Placement]:
    # several pages share the cells of one, so that the work stays the same
    few = shapes.n <= _FEW
    cells = int((_COARSE if few else _CELLS) / np.sqrt(min(options.pages, 6)))
    side = shapes.boxes(least_square_angles(shapes, options.rotate))
    widest = float((side[:, 2:] - side[:, :2]).max())
    density = float(min(_HOPE, 0.97 * shapes.area.sum() / widest**2 / options.pages))
    budget = _COARSE_BUDGET if few else _BUDGET
    work = Work(budget * options.effort, lambda: monitor.expired)
    for _ in range(4):
        cell = cell_size(shapes, options, cells, density)
        angles = chart_angles(shapes, options, cell, 64 if shapes.n <= 30 else 24)
        board = make_board(shapes, options, angles, cells, density)
        found = search(board, shapes, options, cells, work)
        if found:
            return [to_placement(board, f, options) for f in _different(found)]
        density *= 0.75
    return []


def _different(found: list[Found]) -> list[Found]:
    """The best layouts, one of each arrangement: those of one climb often differ in the page side only."""
    kept: list[Found] = []
    for f in found:
        if all(not np.array_equal(f.mask, k.mask) for k in kept):
            kept.append(f)
    return kept[:4]


def _at_fixed_scale(
    shapes: Shapes, options: PackOptions, scale: float, monitor: Monitor
) -> list[Placement]:
    """Layouts at the scale the user fixed, on as few pages as the search finds."""
    inner = options.resolution - 2 * options.border + options.gap
    cells = 160
    # the cell at which a page at that scale has this many cells a side
    density = float(shapes.area.sum() * scale**2 / inner**2 / options.pages)
    if not 0 < density <= 1:
        return []
    cell = cell_size(shapes, options, cells, density)
    angles = chart_angles(shapes, options, cell, 32 if shapes.n <= 30 else 16)
    board = make_board(shapes, options, angles, cells, density)
    work = Work(_BUDGET * options.effort, lambda: monitor.expired)
    found = lay_first(board, shapes, options, cells, work)
    return [] if found is None else [to_placement(board, found, options)]
