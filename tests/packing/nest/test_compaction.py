"""Growing a layout until it locks."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.packing import pack
from circparam.packing.budget import Budget
from circparam.packing.nest import compaction
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.pack import finish
from circparam.packing.skyline import skyline_placement
from tests.support.packing import QUICK


def test_a_bundle_of_needles_makes_no_huge_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parallel needles within reach of each other touch everywhere: such a program is not solved."""
    n = 10
    uv = np.zeros((3 * n, 2))
    uv[1::3, 0] = 1.0
    uv[2::3] = [0.5, 1e-6]
    faces = np.arange(3 * n).reshape(n, 3)
    rows: list[int] = []
    solve = compaction.linprog

    def recorded(*args: object, **options: object) -> object:
        rows.append(options["A_ub"].shape[0])  # type: ignore[attr-defined]
        return solve(*args, **options)

    monkeypatch.setattr(compaction, "linprog", recorded)
    options = PackOptions(resolution=256, padding=2, effort=QUICK)
    pack(faces, uv, np.arange(n), options)
    most = max(rows)
    limit = most // 2
    rows.clear()
    monkeypatch.setattr(compaction, "MOST_ROWS", limit)
    packed = pack(faces, uv, np.arange(n), options)
    assert all(r <= limit for r in rows)
    assert np.isfinite(packed.uv).all()


@pytest.mark.parametrize("seed", range(2))
def test_squeezing_takes_back_steps_that_are_too_long(seed: int) -> None:
    """Steps many times as long as the charts are wide: a tip pushed through a neighbour would stay there."""
    n = 30
    rng = np.random.default_rng(seed)
    uv = np.zeros((3 * n, 2))
    turn = rng.random(n) * 2 * np.pi
    along = np.stack([np.cos(turn), np.sin(turn)], 1)
    uv[1::3] = along
    uv[2::3] = along / 2 + 0.02 * np.stack([-along[:, 1], along[:, 0]], 1)
    shapes = shapes_of(np.arange(3 * n).reshape(n, 3), uv, np.arange(n))
    options = PackOptions(resolution=1024, padding=4)
    start = skyline_placement(shapes, options, Monitor())
    assert start is not None
    after = compaction.compact(shapes, start, options, 12, Budget(1e9, lambda: False), 256.0)
    assert finish(shapes, after, options)[1] is None
    assert after.scale > 1.02 * start.scale
