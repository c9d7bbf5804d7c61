"""Charts that lie on themselves: mirrored halves on one place, packed as one piece that keeps its shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.packing import PackOptions, pack
from circparam.packing.outlines import shapes_of
from circparam.pipeline.inspect import inspect
from circparam.pipeline.unwrap import repack
from tests.support import shapes
from tests.support.formats_tools import corners


def tube() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A barrel open at both ends; seen from the front and from behind at once: folded at its two outlines."""
    round_, faces = shapes.cylinder(24, 16, height=np.pi - 0.3)
    t = round_[:, 2:] + 0.15
    points = np.concatenate([np.cos(t), np.sin(t) * round_[:, :2]], 1)
    return points, faces, points[:, :2] * 0.4 + 0.5


def test_mirrored_halves_are_packed_on_each_other(tmp_path: Path) -> None:
    points, faces, uv = tube()
    square, flat = shapes.grid(2, 2)
    both, every = shapes.join((points, faces), (square + np.array([0, 0, 3]), flat))
    document = from_arrays(both, every, np.concatenate([uv, square[:, :2] * 0.3]), every)
    old = document.uv()
    result = repack(document, tmp_path / "out.obj", resolution=512, padding=4)
    new = read(tmp_path / "out.obj").uv()
    assert new.uv.min() > 0
    assert new.uv.max() < 1
    assert result.measures["gap_texels"] >= 5  # between the two charts
    before, after = corners(old)[: len(faces)], corners(new)[: len(faces)]
    for k in range(2):  # a similarity of the plane, nothing else: all lengths grow alike
        ratio = np.linalg.norm(after[:, k] - after[:, 2], axis=1) / np.linalg.norm(
            before[:, k] - before[:, 2], axis=1
        )
        np.testing.assert_allclose(ratio, np.median(ratio), rtol=1e-6)


@pytest.mark.parametrize("fold", [0.5, 0.3])
def test_folded_charts_cover_what_they_cover(fold: float) -> None:
    """A strip of the unit square, folded once: the raster counts the texels of the longer half, once."""
    points, faces = shapes.grid(11, 2)
    uv = np.stack([np.abs(points[:, 0] - fold), points[:, 1] * 0.5], 1) + 0.1
    document = from_arrays(points, faces, uv, faces)
    found = inspect(document, uv_set=0, resolution=1000).uv
    assert found.flips > 0
    assert found.coverage.share == pytest.approx((1 - fold) * 0.5, abs=2e-3)


@pytest.mark.parametrize("seed", range(4))
def test_a_closed_surface_seen_from_one_side_is_packed(seed: int) -> None:
    """Its outline are folds alone, and every corner of them counts, whatever the order of its faces."""
    points, faces = shapes.icosphere(2)
    faces = np.random.default_rng(seed).permutation(faces)
    uv, options = points[:, :2], PackOptions(256, 2)
    shown = shapes_of(faces, uv, np.zeros(len(faces), np.int64))
    low, high = uv.min(0) - (uv.min(0) + uv.max(0)) / 2, np.ptp(uv, axis=0) / 2
    np.testing.assert_allclose(shown.boxes(np.zeros(1))[0], [*low, *high])
    packed = pack(faces, uv, np.zeros(len(faces), np.int64), options)
    assert packed.uv.min() > 0
    assert packed.uv.max() < 1
