"""Images at uv: sampled between texels, and laid out anew where a file moves its uv."""

import numpy as np
from PIL import Image

from circparam.core.types import FloatArray

LARGEST_SIDE_TEXELS = 2048  # texels a side of a texture inside a page


def bilinear(image: FloatArray, uv: FloatArray) -> FloatArray:
    """(p, c) colours of an (h, w, c) image at uv (p, 2), origin bottom-left, repeated beyond its edges."""
    h, w = image.shape[:2]
    x = uv[:, 0] * w - 0.5
    y = (1 - uv[:, 1]) * h - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    i0, j0 = x0.astype(np.int64) % w, y0.astype(np.int64) % h
    i1, j1 = (i0 + 1) % w, (j0 + 1) % h
    top = image[j0, i0] * (1 - fx) + image[j0, i1] * fx
    bottom = image[j1, i0] * (1 - fx) + image[j1, i1] * fx
    return top * (1 - fy) + bottom * fy


def unmoved(image: Image.Image, move: FloatArray) -> Image.Image:
    """The image that shows at uv the colours of ``image`` at the place to which ``move`` (2, 3) takes uv.

    The image is the unit square of uv, with the texel density of the source. Beyond the square it repeats, as
    the image itself does where the map takes whole units to whole units.
    """
    size = np.linalg.norm(move[:, :2] * np.array(image.size)[:, None], axis=0)
    width, height = np.clip(np.ceil(size - 1e-9), 1, LARGEST_SIDE_TEXELS).astype(int).tolist()
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    uv = np.stack([x.ravel(), y.ravel()], 1) @ move[:, :2].T + move[:, 2]
    pixels = bilinear(np.asarray(image, np.float64), uv)
    return Image.fromarray(np.round(pixels).astype(np.uint8).reshape(height, width, -1), image.mode)
