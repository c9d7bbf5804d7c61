"""Fourier transforms of SciPy without its choice of backends, which imports all special functions."""

from typing import Any

from circparam.core.imports import alone

try:
    with alone("scipy.fft"):
        from scipy.fft._pocketfft import (  # type: ignore[import-not-found]
            fft,
            ifft,
            irfft,
            irfftn,
            rfft,
            rfftn,
        )
        from scipy.fft._pocketfft.helper import good_size  # type: ignore[import-not-found]
except ImportError:  # modules that are private to SciPy, in a version that has them elsewhere
    from scipy.fft import fft, ifft, irfft, irfftn, next_fast_len, rfft, rfftn

    def good_size(target: int, real: bool) -> int:
        """A size from ``target`` on whose transform is fast."""
        return int(next_fast_len(target, real))


def rfft2(a: Any) -> Any:
    """The transform of real arrays (..., h, w) over the last two axes."""
    return rfftn(a, axes=(-2, -1))


def irfft2(a: Any, s: tuple[int, int]) -> Any:
    """The inverse of ``rfft2`` for arrays of size s."""
    return irfftn(a, s, axes=(-2, -1))


__all__ = ["fft", "good_size", "ifft", "irfft", "irfft2", "rfft", "rfft2"]
