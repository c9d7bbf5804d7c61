"""``--align-texels``: straight borders on whole texels or blocks, gaps and bounds kept."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from tests.support import parts, shapes
from tests.support.command_line import obj

QUICK = {"effort": 0.01, "jobs": 1}


def boxes(count: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Rectangles of many sizes beside each other, a chart each."""
    rng = np.random.default_rng(4)
    sheets = []
    for k in range(count):
        points, faces = shapes.grid(3, 3, *rng.uniform(0.3, 1.5, 2))
        sheets.append((points @ shapes.rotation(k).T + [3.0 * k, 0.0, 0.0], faces))
    return shapes.join(*sheets)


def off_blocks(result: circparam.Result, side: int, block: int) -> np.ndarray:
    """(n_charts, 4): how far the sides of each chart are from a multiple of the block, in texels."""
    found = result.verification
    chart = found.cut_mesh.vertex_chart
    out = []
    for k in range(found.cut_mesh.n_charts):
        p = found.uv[chart == k] % 1 * side
        out.append(np.r_[p.min(0), p.max(0)])
    box = np.array(out)
    return np.abs(box - block * np.rint(box / block))


@pytest.mark.parametrize(
    ("side", "block", "more"),
    [(512, 1, {}), (512, 4, {}), (640, 5, {}), (512, 4, {"pages": 2}), (512, 1, {"rotate": "90"})],
)
def test_rectangles_lie_on_whole_blocks(side: int, block: int, more: dict[str, object]) -> None:
    asked = {"resolution": side, "padding": 2, "align_texels": block, **QUICK, **more}
    if "rotate" not in more:
        asked["straighten"] = "all"
    result = circparam.unwrap(boxes(), **asked)
    assert result.status == "ok"
    if "rotate" not in more:
        assert off_blocks(result, side, block).max() < 1e-3
        assert result.measures["texel_aligned"] == 1.0
    assert result.verification.coverage.gap >= 3
    assert result.verification.coverage.border >= 2
    assert result.measures["distortion_max_chart"] <= 1.05 * (1 + 1e-4)


def test_without_the_option_few_borders_lie_there() -> None:
    result = circparam.unwrap(boxes(), straighten="all", resolution=512, **QUICK)
    assert 0.0 <= result.measures["texel_aligned"] < 0.5
    assert result.measures["axis_parallel"] == pytest.approx(1.0)


@pytest.mark.parametrize("block", [1, 4])
def test_bounds_hold_where_blocks_are_coarse(block: int, tmp_path: Path) -> None:
    """A gear on a small page: teeth of few texels, and strips a few blocks wide."""
    gear, path = parts.gear(), tmp_path / "gear.obj"
    asked = {"straighten": "all", "resolution": 128, "padding": 1, **QUICK}
    whole = asked | {"pack_splits": 0}
    plain = circparam.unwrap((gear.points, gear.faces), path, **whole)
    moved = circparam.unwrap((gear.points, gear.faces), align_texels=block, **whole)
    for result in (moved, circparam.repack(path, align_texels=block, **asked)):
        assert result.status == "ok"
        assert result.verification.valid
        assert result.verification.coverage.gap >= 2
        assert result.measures["texel_aligned"] > plain.measures["texel_aligned"]


def test_a_chart_above_the_bound_keeps_its_shape(tmp_path: Path) -> None:
    """``pack`` of charts above any bound moves them, and keeps their shapes."""
    points, faces = shapes.grid(5, 5)
    uv = points[:, :2] * [6.0, 1.0]
    path = obj(tmp_path / "stretched.obj", (points, faces), uv)
    result = circparam.repack(path, align_texels=4, straighten="all", resolution=256, jobs=1)
    size = np.ptp(result.uv, axis=0)
    assert max(size) / min(size) == pytest.approx(6.0, rel=1e-5)
