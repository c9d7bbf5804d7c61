"""Fourier transforms of SciPy without its choice of backends, which imports all special functions."""

from typing import Any

from circparam.core.imports import private

fft, ifft, rfft, irfft, rfftn = (
    private("scipy.fft._pocketfft", name, "scipy.fft")
    for name in ("fft", "ifft", "rfft", "irfft", "rfftn")
)
_fast_size = private("scipy.fft._pocketfft.helper", "good_size")
good_size = _fast_size or private("scipy.fft", "next_fast_len")  # (least size, real) → a fast one


def rfft2(a: Any) -> Any:
    """The transform of real arrays (..., h, w) over the last two axes."""
    return rfftn(a, axes=(-2, -1))
