"""Growing a layout until it locks."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.budget import Budget
from circparam.packing.nest.compaction import Ascent, Growth
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, shapes_of
from circparam.packing.pack import finish
from circparam.packing.placement import PackTask, Placement
from circparam.packing.skyline import skyline_placement

OPTIONS = PackOptions(resolution=1024, padding=4)


def growth_of(shapes, options, rows=1e9):
    return Growth(shapes, options, Budget(rows, lambda: False))


def needles(seed: int) -> tuple[Shapes, Placement]:
    """Thirty thin triangles at any angle, and their layout on the skyline."""
    n = 30
    rng = np.random.default_rng(seed)
    uv = np.zeros((3 * n, 2))
    turn = rng.random(n) * 2 * np.pi
    along = np.stack([np.cos(turn), np.sin(turn)], 1)
    uv[1::3] = along
    uv[2::3] = along / 2 + 0.02 * np.stack([-along[:, 1], along[:, 0]], 1)
    shapes = shapes_of(np.arange(3 * n).reshape(n, 3), uv, np.arange(n))
    return shapes, skyline_placement(PackTask(shapes, OPTIONS))


@pytest.mark.parametrize("seed", range(2))
def test_compaction_takes_back_steps_that_are_too_long(seed: int) -> None:
    """Steps many times as long as the charts are wide: a tip pushed through a neighbour would stay there."""
    shapes, start = needles(seed)
    after = Ascent(start, 256.0).climb(growth_of(shapes, OPTIONS))
    assert finish(shapes, after, OPTIONS)[1] is None
    assert after.scale > 1.02 * start.scale


@pytest.mark.parametrize("rows", [1000, 2000])
def test_a_step_whose_program_is_too_large_is_followed_by_a_shorter_one(rows: int) -> None:
    """Near charts meet more of the others, the further they move."""
    shapes, start = needles(0)
    assert Ascent(start, 256.0).climb(growth_of(shapes, OPTIONS, rows)).scale > start.scale


def test_gaps_that_are_too_narrow_are_mended_without_growth() -> None:
    """Squares in a row, half a texel too near each other, with room on both sides."""
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    n = 4
    shapes = shapes_of(
        np.concatenate([faces + 4 * k for k in range(n)]),
        np.tile(uv, (n, 1)),
        np.repeat(range(n), 2),
    )
    offset = np.stack([200.0 + 103.6 * np.arange(n), np.full(n, 500.0)], 1)
    near = Placement(100.0, np.zeros(n), offset, np.zeros(n, int))
    assert finish(shapes, near, OPTIONS)[1] is not None
    after = Ascent(near).settle(growth_of(shapes, OPTIONS))
    assert finish(shapes, after, OPTIONS)[1] is None
    assert after.scale <= near.scale


def test_three_faces_at_an_edge_are_no_overlap() -> None:
    """The outline of such a chart is not closed: it says nothing of the rows where it lies."""
    uv = np.array([[0.0, 0], [0, 1], [-1, 0.5], [-0.9, 0.6], [-0.8, 0.4], [4, 0], [5, 0], [4, 1]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [5, 6, 7]])
    options = PackOptions(resolution=256, padding=2)
    shapes = shapes_of(faces, uv, np.array([0, 0, 0, 1]))
    offset = np.array([[70.0, 120.0], [180.0, 120.0]])
    apart = Placement(60.0, np.zeros(2), offset, np.zeros(2, int))
    growth = growth_of(shapes, options)
    assert finish(shapes, apart, options)[1] is None
    assert Ascent(apart).climb(growth).scale > 1.2 * apart.scale
