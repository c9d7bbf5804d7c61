"""Charts put between others that lie already."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.packing.nest.between import completed
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, shapes_of
from circparam.packing.placement import PackTask, Placement

PAGE = PackOptions(resolution=512, padding=2)


def squares(*sides: float) -> tuple[IntArray, FloatArray, IntArray]:
    """A square of two triangles for each side, from its lower left corner at the origin."""
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    uv = np.concatenate([corner * s for s in sides])
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(len(sides))])
    return faces, uv, np.repeat(np.arange(len(sides)), 2)


def quarters(shapes: Shapes, scale: float) -> Placement:
    """The first three charts in three quarters of the page, the others nowhere."""
    n, at = shapes.n, PAGE.resolution * np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75]])
    offset, page = np.zeros((n, 2)), np.full(n, -1)
    offset[:3], page[:3] = at, 0
    return Placement(scale, np.zeros(n), offset, page)


def put(shapes: Shapes, start: Placement, effort: float = 100.0) -> Placement | None:
    options = replace(PAGE, effort=effort)
    return completed(PackTask(shapes, options, Monitor(), {}, lambda _: True, start), start)


def apart(shapes: Shapes, found: Placement) -> bool:
    """Whether the boxes of all charts lie on the page, no two on the same place."""
    world = shapes.place(found.angle, found.offset, found.scale)
    box = [world[shapes.owner == c] for c in range(shapes.n)]
    low, high = np.array([b.min(0) for b in box]), np.array([b.max(0) for b in box])
    over = (low[:, None] < high[None]).all(2) & (low[None] < high[:, None]).all(2)
    inside = (low >= 0).all() and (high <= PAGE.resolution).all()
    return bool(inside and not (over & ~np.eye(shapes.n, dtype=bool)).any())


def test_small_charts_fill_what_is_free() -> None:
    """Four small squares come into the free quarter, and nothing that lay there moves."""
    shapes = shapes_of(*squares(1.0, 1.0, 1.0, 0.4, 0.4, 0.4, 0.4))
    start = quarters(shapes, 0.46 * PAGE.resolution)
    found = put(shapes, start)
    assert found is not None
    assert found.scale == pytest.approx(start.scale)
    assert np.allclose(found.offset[:3], start.offset[:3])
    assert (found.page == 0).all()
    assert (found.offset[3:] > PAGE.resolution / 2).all()
    assert apart(shapes, found)


def test_the_page_grows_where_they_find_no_room() -> None:
    """Squares too wide for the free quarter take a page that is larger by as little as is tried."""
    shapes = shapes_of(*squares(1.0, 1.0, 1.0, 0.56, 0.56, 0.56, 0.56))
    start = quarters(shapes, 0.46 * PAGE.resolution)
    found = put(shapes, start)
    assert found is not None
    assert 0.75 * start.scale < found.scale < start.scale
    assert apart(shapes, found)


def test_what_finds_no_room_or_no_time_is_left() -> None:
    shapes = shapes_of(*squares(1.0, 1.0, 1.0, 1.9, 0.4))
    start = quarters(shapes, 0.46 * PAGE.resolution)
    assert put(shapes, start) is None
    shapes = shapes_of(*squares(1.0, 1.0, 1.0, 0.4, 0.4))
    assert put(shapes, quarters(shapes, 0.46 * PAGE.resolution), effort=1e-9) is None
