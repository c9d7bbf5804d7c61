"""Charts with straight borders lie along the axes of the page, and stay so while they are compacted."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.geometry.straight import directions
from circparam.packing import pack
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.straight import straight_charts
from tests.support.packing import blobs, boxes

QUARTER = np.pi / 2


def turned_boxes(n: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rectangles of all sizes, each turned by some angle: (faces, uv, chart, angles)."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 6, n)
    return *boxes(rng.uniform(0.3, 1.5, (n, 2)), angle), angle


def askew(faces: np.ndarray, uv: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """How far the first edge of the first face of every chart is from an axis, in radians."""
    first = faces[np.unique(chart, return_index=True)[1]]
    d = uv[first[:, 1]] - uv[first[:, 0]]
    turn = np.arctan2(d[:, 1], d[:, 0])
    return np.abs(np.mod(turn + QUARTER / 2, QUARTER) - QUARTER / 2)


def test_the_angle_lays_borders_along_the_axes() -> None:
    faces, uv, chart, angle = turned_boxes(20, 1)
    found = straight_charts(shapes_of(faces, uv, chart), np.inf)
    assert found.counts.all()
    off = np.mod(found.angle + angle + QUARTER / 2, QUARTER) - QUARTER / 2
    np.testing.assert_allclose(off, 0, atol=1e-9)
    assert found.lying(found.angle + QUARTER * np.arange(20)).all()
    assert not found.lying(found.angle + 1e-6).any()


def test_round_and_long_charts_do_not_count() -> None:
    assert not straight_charts(shapes_of(*blobs(20, 3)), np.inf).counts.any()
    faces, uv, chart, _ = turned_boxes(20, 1)
    shapes = shapes_of(faces, uv, chart)
    some = straight_charts(shapes, 1.0).counts
    assert 0 < some.sum() < 20


@pytest.mark.parametrize("seed", [1, 2])
def test_boxes_lie_along_the_axes_beside_round_charts(seed: int) -> None:
    """Of these seeds, where it costs hardly any room; otherwise they may lie askew."""
    faces, uv, chart, _ = turned_boxes(14, seed)
    more, round_uv, round_chart = blobs(4, seed, 0.2)
    both = np.concatenate([faces, more + len(uv)])
    charts = np.concatenate([chart, round_chart + 14])
    packed = pack(both, np.concatenate([uv, round_uv * 0.3]), charts, PackOptions(512, 2))
    assert (askew(faces, packed.uv[: len(uv)], chart) < 1e-9).sum() == 14
    assert packed.share[0] > 0.6


def test_one_box_alone_fills_its_page() -> None:
    """It fits a smaller square only askew if it is long, and then it lies so."""
    for height, along in ((0.98, True), (0.05, False)):
        faces, uv, chart = boxes([[1.0, height]], 0.4)
        off = askew(faces, pack(faces, uv, chart, PackOptions(512, 2)).uv, chart)[0]
        assert off < 1e-9 if along else off > 0.7


@pytest.mark.parametrize("count", [1, 7, 60, 300])
def test_every_packer_keeps_straight_charts_upright(count: int) -> None:
    """One chart, few, those of the skyline, and more than are nested."""
    rng = np.random.default_rng(count)
    charts = boxes(0.2 + rng.random((count, 2)), 3 * rng.random(count))
    asked = PackOptions(resolution=512, padding=1, effort=0.05, straighten="all")
    side = np.diff(pack(*charts, asked).uv.reshape(count, 4, 2), axis=1)
    assert np.abs(side).min(2).max() < 1e-9


def test_the_border_of_a_rectangle_runs_along_its_own_axes() -> None:
    """However long its sides are and however it is turned."""
    faces, uv, chart, angle = turned_boxes(9, 2)
    shapes = shapes_of(faces, uv, chart)
    edges = uv[shapes.end] - uv[shapes.start]
    owner = shapes.owner[shapes.start]
    found = directions(edges, owner, 9)
    perimeter = np.bincount(owner, np.linalg.norm(edges, axis=1))
    np.testing.assert_allclose(found.length, perimeter)
    np.testing.assert_allclose(found.share, 1.0)
    off = np.mod(found.angle - angle + QUARTER / 2, QUARTER) - QUARTER / 2
    np.testing.assert_allclose(off, 0.0, atol=1e-9)
