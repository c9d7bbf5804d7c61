"""Greedy placement on grids: the correlation of a page with the masks of a chart finds the best free place."""

from dataclasses import field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from circparam.core.imports import OnDemand
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.packing.nest.masks import Masks

# brings scipy.special along, and a chart alone on its page needs neither
sf = OnDemand("circparam.core.fourier")

Spectrum = npt.NDArray[np.complex64]
Single = npt.NDArray[np.float32]

# Threads of the transforms: a second thread costs 70 µs a call, about the time of one chart.
FFT_THREADS = 1


@lru_cache(maxsize=64)
def blur_transfer(side: int, sigma: float) -> FloatArray:
    """Transfer function of a Gaussian of ``sigma`` cells on the FFT grid, (side, side // 2 + 1)."""
    f0, f1 = np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None]
    return np.exp(-2 * (np.pi * sigma) ** 2 * (f0 * f0 + f1 * f1)).astype(np.float32)


def best_place(
    page: Spectrum,
    kernel: Spectrum,
    blur: FloatArray,
    area: FloatArray | Single,
    rows: IntArray,
    columns: IntArray,
    side: int,
) -> tuple[int, int, int] | None:
    """Mask, row, column of the free place with the highest contact score; None if nothing is free.

    Only places are looked at where some mask lies on the page; cells beyond it are taken. One transform tells
    which are free, and their contact.
    """
    tall, wide = side + 1 - int(rows.min()), side + 1 - int(columns.min())
    # weight of a taken cell: more than the contact of any mask
    used = 2 * np.float32(area.max())
    # the inverse transform, to the last bit, of the first rows and columns alone
    size = kernel.shape[1]
    half = sf.ifft(
        kernel * (page * (blur + used)),
        axis=1,
        norm="forward",
        overwrite_x=True,
        workers=FFT_THREADS,
    )[:, :tall]
    contact = sf.irfft(half, n=size, axis=2, norm="forward", workers=FFT_THREADS)[:, :, :wide]
    contact = contact * np.float32(1 / size**2)
    free = contact < 0.75 * used
    score = np.where(free, contact / area[:, None, None], -1)
    k, rest = divmod(int(score.argmax()), tall * wide)
    row, column = divmod(rest, wide)
    return (k, row, column) if free[k, row, column] else None


def spectra_of(masks: Masks, size: int) -> Spectrum:
    """(k, size, size // 2 + 1) conjugate spectra of the masks of a chart on a grid of ``size`` cells a side."""
    # the rows below a mask are empty, and so are their transforms
    rows = sf.rfft(masks.cells[:, :size, :size].astype(np.float32), n=size, axis=2)
    return np.conj(sf.fft(rows, n=size, axis=1))


@dataclass(frozen=True, eq=False)
class GridPages:
    """Pages that charts are placed on greedily. used: (pages, size, size) float32, 1 in cells that are taken.

    side: cells a side that are free on an empty page; the rest of the grid is taken. sigma: blur of the contact
    score in cells.
    """

    used: Single
    side: int
    sigma: float
    spectra: dict[int, Spectrum] = field(default_factory=dict)

    @classmethod
    def empty(cls, pages: int, size: int, side: int, sigma: float) -> "GridPages":
        """Pages without a chart."""
        used: Single = np.ones((pages, size, size), np.float32)
        used[:, :side, :side] = 0
        return cls(used, side, sigma)

    def find(
        self, masks: Masks, kernel: Spectrum, pick: IntArray, area: FloatArray | Single
    ) -> tuple[int, int, int, int] | None:
        """Mask, row, column and page of the best free place, on the first page that has one.

        pick: (p,) the masks that are tried. kernel, area: (p, ...) their spectra and numbers of cells.
        """
        rows, columns = masks.size[pick].T
        blur = blur_transfer(self.used.shape[1], self.sigma)
        for page, cells in enumerate(self.used):
            if page not in self.spectra:
                self.spectra[page] = sf.rfft2(cells)
            at = best_place(self.spectra[page], kernel, blur, area, rows, columns, self.side)
            if at is not None:
                return int(pick[at[0]]), at[1], at[2], page
        return None

    def fill(self, masks: Masks, k: int, row: int, column: int, page: int = 0) -> None:
        """Take the cells of mask k."""
        h, w = masks.size[k]
        self.used[page, row : row + h, column : column + w][masks.cells[k, :h, :w]] = 1
        self.spectra.pop(page, None)
