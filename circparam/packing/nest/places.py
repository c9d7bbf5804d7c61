"""Places for one chart among others: a page correlated with its masks by FFT tells which are free and best."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.imports import OnDemand

# brings scipy.special along, and a chart alone on its page needs neither
sf = OnDemand("scipy.fft")

Spectrum = npt.NDArray[np.complex64]
Single = npt.NDArray[np.float32]

# Threads of the transforms: a second one costs 70 µs a call, about what those of one chart take.
THREADS = 1

# What contacts that are told beside cells in use are off by at most, as a share of what such a cell counts as
NOISE = 2e-6


@lru_cache(maxsize=64)
def blur_transfer(side: int, sigma: float) -> FloatArray:
    """Transfer function of a Gaussian of ``sigma`` cells on the FFT grid, (side, side // 2 + 1)."""
    f0, f1 = sf.fftfreq(side)[:, None], sf.rfftfreq(side)[None]
    gauss: FloatArray = np.exp(-2 * (np.pi * sigma) ** 2 * (f0 * f0 + f1 * f1)).astype(np.float32)
    return gauss


def best_place(
    page: Spectrum,
    kernel: Spectrum,
    blur: FloatArray,
    area: FloatArray | Single,
    rows: IntArray,
    columns: IntArray,
    side: int,
) -> tuple[int, int, int] | None:
    """Mask, row, column of the free place with the highest contact score; None where nothing is free.

    Only places are looked at where some mask lies on the page. One transform tells which are free, and nearly
    how much they touch; where several may be the best, their masks are looked at again.
    """
    tall, wide = side + 1 - int(rows.min()), side + 1 - int(columns.min())
    # what a cell in use counts as: more than all that a mask may touch
    used = 2 * np.float32(area.max())
    contact = _at_places(kernel * (page * (blur + used)), tall, wide)
    free = contact < 0.75 * used
    free &= (np.arange(tall)[None] <= side - rows[:, None])[:, :, None]
    free &= (np.arange(wide)[None] <= side - columns[:, None])[:, None, :]
    score = np.where(free, contact / area[:, None, None], -1).ravel()
    highest = float(score.max())
    if highest < 0:
        return None
    near = np.flatnonzero(score >= highest - NOISE * used)
    if len(near) > 1:
        some = np.unique(near // (tall * wide))
        score = _at_places(kernel[some] * (page * blur), tall, wide)
        score = np.where(free[some], score / area[some, None, None], -1)
        k, rest = divmod(int(score.argmax()), tall * wide)
        return int(some[k]), rest // wide, rest % wide
    k, rest = divmod(int(near[0]), tall * wide)
    return k, rest // wide, rest % wide


def _at_places(product: Spectrum, tall: int, wide: int) -> Single:
    """(k, tall, wide) the first rows and columns of what products of spectra (k, n, n // 2 + 1) stand for.

    As ``irfft2`` gives them, to the last bit: it transforms the rows that are not asked for as well.
    """
    size = product.shape[1]
    half = sf.ifft(product, axis=1, norm="forward", overwrite_x=True, workers=THREADS)[:, :tall]
    whole = sf.irfft(half, n=size, axis=2, norm="forward", workers=THREADS)[:, :, :wide]
    found: Single = whole * np.float32(1 / size**2)
    return found
