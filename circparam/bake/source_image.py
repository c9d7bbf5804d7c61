"""An image for many look-ups: its codes as whole words, averaged levels, wrap modes.

Samples blend the four texels round a place in linear light, as graphics hardware does for sRGB textures
(bilinear). They use the level whose texels have about the size of a sample.
"""

from functools import cache, cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.looks import Use, Wrap
from circparam.formats.materials import linear, srgb

Floats = npt.NDArray[np.float32]
# linear light in so many steps → code of 8 bit; the steepest part of the curve, 12.92, moves 0.05 codes a step
LINEAR_STEPS = 65535
WHOLE_IMAGE_PIXELS = 1 << 22  # pixels up to which an image is decoded as a whole, in 64 MB


@dataclass(frozen=True, eq=False)
class Taps:
    """Texels (p,) to blend: one, or upper left, upper right, lower left and lower right, with the shares (p, 1)
    of the right and the lower ones."""

    texels: list[IntArray]
    right: Floats | None = None
    below: Floats | None = None


class SourceImage:
    """An image (h, w, 4) of 8 or 16 bit. is_srgb: its red, green and blue are coded so."""

    def __init__(
        self, image: npt.NDArray[np.uint8] | npt.NDArray[np.uint16], is_srgb: bool
    ) -> None:
        self.height, self.width = image.shape[:2]
        self._image = np.ascontiguousarray(image)
        word = np.uint32 if image.dtype == np.uint8 else np.uint64
        self._words = self._image.view(word).ravel()
        top = np.iinfo(image.dtype).max
        plain = np.arange(top + 1) / top
        self._alpha = plain.astype(np.float32)
        self._value = linear(plain).astype(np.float32) if is_srgb else self._alpha
        self._levels: dict[int, Floats] = {}

    @cached_property
    def whole(self) -> Floats:
        """(h, w, 4) in linear light."""
        return self._decoded(self._image)

    def _decoded(self, codes: npt.NDArray[Any]) -> Floats:
        out = np.empty(codes.shape, np.float32)
        for k in range(4):
            out[..., k] = (self._alpha if k == 3 else self._value).take(codes[..., k])
        return out

    def level(self, number: int) -> Floats:
        """(⌈h / 2ⁿ⌉, ⌈w / 2ⁿ⌉, 4) means of 2ⁿ × 2ⁿ texels in linear light."""
        if number not in self._levels:
            above = self.whole if number == 1 else self.level(number - 1)
            h, w = above.shape[:2]
            even = np.pad(above, ((0, h % 2), (0, w % 2), (0, 0)), mode="edge")
            mean = even.reshape(len(even) // 2, 2, -1, 2, 4).mean((1, 3), dtype=np.float32)
            self._levels[number] = mean
        return self._levels[number]

    @property
    def levels(self) -> int:
        """The number of the smallest level."""
        return int(np.ceil(np.log2(max(self.width, self.height, 1))))

    def taps(self, x: FloatArray, y: FloatArray, use: Use, level: int) -> Taps:
        """The texels round places (p,) in the image, 0..1, y down; those of any image of the same size."""
        size = 1 << level
        h, w = -(-self.height // size), -(-self.width // size)
        x, y = x * (self.width / size), y * (self.height / size)
        if use.nearest:
            i, j = wrapped(np.floor(x), w, use.wrap[0]), wrapped(np.floor(y), h, use.wrap[1])
            return Taps([j * w + i])
        x0, y0 = np.floor(x - 0.5), np.floor(y - 0.5)
        right = (x - 0.5 - x0).astype(np.float32)[:, None]
        below = (y - 0.5 - y0).astype(np.float32)[:, None]
        i0, i1 = (wrapped(x0 + k, w, use.wrap[0]) for k in (0, 1))
        j0, j1 = (wrapped(y0 + k, h, use.wrap[1]) * w for k in (0, 1))
        return Taps([j0 + i0, j0 + i1, j1 + i0, j1 + i1], right, below)

    def blend(self, taps: Taps, level: int) -> Floats:
        """(p, 4) linear values between the texels of taps."""
        values = [self._take(texels, level) for texels in taps.texels]
        if taps.right is None or taps.below is None:
            return values[0]
        upper, upper_right, lower, lower_right = values
        for one, other, share in (
            (upper, upper_right, taps.right), (lower, lower_right, taps.right), (upper, lower, taps.below)
        ):  # fmt: skip
            other -= one
            other *= share
            one += other
        return upper

    def _take(self, at: IntArray, level: int) -> Floats:
        """(p, 4) linear values of texels by their numbers."""
        if level:
            return self.level(level).reshape(-1, 4).take(at, axis=0)
        if self.width * self.height <= WHOLE_IMAGE_PIXELS:
            return self.whole.reshape(-1, 4).take(at, axis=0)
        codes = self._words.take(at).view(self._image.dtype).reshape(-1, 4)
        return self._decoded(codes)


def wrapped(index: FloatArray, size: int, wrap: Wrap) -> IntArray:
    """Whole numbers of texels brought into 0..size − 1 as a sampler does it (glTF 2.0, 3.8.4.4)."""
    k = np.nan_to_num(np.clip(index, -(2.0**52), 2.0**52)).astype(np.int64)
    if wrap == "clamp":
        return np.clip(k, 0, size - 1)
    if wrap == "mirror":
        k = k % (2 * size)
        return np.minimum(k, 2 * size - 1 - k)
    return k % size


def coded(values: npt.NDArray[np.floating], as_srgb: bool) -> npt.NDArray[np.uint8]:
    """Values 0..1 as codes of 8 bit; as_srgb: linear light, coded so."""
    step = np.nan_to_num(np.clip(values, 0, 1) * LINEAR_STEPS + 0.5).astype(np.uint16)
    return _codes(as_srgb).take(step)


@cache
def _codes(as_srgb: bool) -> npt.NDArray[np.uint8]:
    value = np.arange(LINEAR_STEPS + 1) / LINEAR_STEPS
    return np.round((srgb(value) if as_srgb else value) * 255).astype(np.uint8)
