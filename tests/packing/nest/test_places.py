"""Places for one chart among others, beside all places looked at one by one."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.packing.nest.places import best_place, blur_transfer


def by_hand(grid, blurred, masks, sizes, side):
    """The highest score of a free place, and all places that have it to 1e-4."""
    scores = {}
    for k, (mask, (h, w)) in enumerate(zip(masks, sizes, strict=True)):
        for y in range(side - h + 1):
            for x in range(side - w + 1):
                if not (grid[y : y + h, x : x + w] * mask[:h, :w]).any():
                    touched = (blurred[y : y + h, x : x + w] * mask[:h, :w]).sum()
                    scores[k, y, x] = touched / mask.sum()
    best = max(scores.values(), default=None)
    return best, {at for at, score in scores.items() if score > best - 1e-4}


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.05, 0.3, 0.8]), st.sampled_from([1, 4]))
def test_the_place_is_free_and_touches_most(seed: int, full: float, beyond: int):
    """Whatever is looked at again. The grid is larger than the page, so that masks do not reach round it."""
    rng = np.random.default_rng(seed)
    size = 20
    side = size - beyond
    sizes = rng.integers(1, 12, (int(rng.integers(1, 6)), 2))
    masks = np.zeros((len(sizes), 12, 12), np.float32)
    for mask, (h, w) in zip(masks, sizes, strict=True):
        mask[:h, :w] = rng.random((h, w)) < 0.7
        mask[0, :w] = mask[h - 1, :w] = mask[:h, 0] = mask[:h, w - 1] = 1
    grid = np.ones((size, size), np.float32)
    grid[:side, :side] = rng.random((side, side)) < full
    blur = blur_transfer(size, 2.0)
    page = np.fft.rfft2(grid)
    blurred = np.fft.irfft2(page * blur, s=grid.shape)
    block = np.zeros((len(masks), size, size))
    block[:, :12, :12] = masks
    kernel = np.conj(np.fft.rfft2(block)).astype(np.complex64)
    found = best_place(page.astype(np.complex64), kernel, blur, masks.sum((1, 2)), *sizes.T, side)
    best, good = by_hand(grid, blurred, masks, sizes, side)
    assert (found is None) == (best is None)
    assert found is None or found in good
