"""The gaps that follow from the padding, and the mip level that a padding is good for."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from circparam.core.limits import auto_padding, mip_level
from circparam.packing import pack
from circparam.packing.options import PackOptions, lattice_gap, strip_gap
from tests.support.packing import blobs, covered


def differences(padding):
    """Differences of texel centres that are nearer than padding + 1, as (k, 2) whole numbers."""
    side = np.arange(-padding - 1, padding + 2)
    d = np.stack(np.meshgrid(side, side), 2).reshape(-1, 2)
    return d[(d**2).sum(1) < (padding + 1) ** 2]


@pytest.mark.parametrize("padding", range(12))
def test_the_gap_is_the_largest_distance_that_is_too_near(padding):
    longest = np.sqrt((differences(padding) ** 2).sum(1).max())
    assert lattice_gap(padding) == pytest.approx(longest, abs=1e-12)
    options = PackOptions(padding=padding)
    assert options.gap > max(longest, np.sqrt(2))
    assert options.gap == pytest.approx(max(longest, np.sqrt(2)), abs=0.011)
    assert options.box_gap == pytest.approx(max(padding, 1), abs=0.011)
    assert options.border == pytest.approx(max(padding - 0.5, 0), abs=0.011)


@pytest.mark.parametrize("padding", range(1, 10))
def test_a_strip_is_as_wide_as_any_pair_of_near_centres_reaches(padding):
    angle = np.linspace(0, 2 * np.pi, 37)
    normal = np.stack([np.cos(angle), np.sin(angle)], 1)
    reach = (differences(padding) @ normal.T).max(0)
    width = strip_gap(padding, normal)
    assert (width > np.maximum(reach, np.sqrt(2))).all()
    assert width == pytest.approx(np.maximum(reach, np.sqrt(2)), abs=0.011)
    assert width[0] == pytest.approx(max(padding, np.sqrt(2)), abs=0.011)
    assert (width <= PackOptions(padding=padding).gap + 1e-12).all()


def test_the_padding_grows_with_the_page() -> None:
    assert [auto_padding(side) for side in (64, 1024, 2048, 4096, 8192)] == [1, 2, 4, 8, 16]
    # the next page that is no multiple: never more than there is room for
    assert [auto_padding(side) for side in (700, 1500, 2047, 4000)] == [1, 2, 3, 7]
    levels = [mip_level(p) for p in range(200)]
    assert [levels.index(k) for k in (None, *range(6))] == [0, 4, 8, 16, 33, 67, 135]
    assert levels[4:] == sorted(levels[4:])


@pytest.mark.parametrize("padding", [4, 8, 17])
def test_no_texel_of_a_neighbour_bleeds_in(padding: int) -> None:
    """Every bilinear sample in a covered texel sees one chart alone at that level; two levels on not."""
    side = 256
    faces, uv, chart = blobs(7, 4, 0.3)
    packed = pack(faces, uv, chart, PackOptions(side, padding, effort=0.05))
    owner, _ = covered(faces, packed.uv, chart, side)
    near = distance_transform_edt(owner < 0, return_distances=False, return_indices=True)
    filled = owner[near[0], near[1]]
    level = mip_level(padding)
    assert not _bleeds(owner, filled, level)
    assert _bleeds(owner, filled, level + 2)


def _bleeds(owner: np.ndarray, filled: np.ndarray, level: int) -> bool:
    """Whether a bilinear sample somewhere in a covered texel takes in a texel of another chart."""
    size = 2**level
    n = -(-len(owner) // size)
    wide = np.pad(filled, (0, n * size - len(filled)), mode="edge").reshape(n, size, n, size)
    low, high = wide.min((1, 3)), wide.max((1, 3))
    texel = np.argwhere(owner >= 0)
    own = owner[tuple(texel.T)]
    for sample, step in product(product((0.0, 0.999), repeat=2), product((0, 1), repeat=2)):
        # one of the four texels of that level round the sample
        at = np.floor((texel + sample) / size - 0.5).astype(int) + step
        row, column = np.clip(at, 0, n - 1).T
        if ((low[row, column] != own) | (high[row, column] != own)).any():
            return True
    return False
