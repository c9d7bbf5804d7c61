"""Colours of an image at uv, and pictures made smaller."""

import numpy as np

from circparam.render.texture import bilinear
from circparam.render.views import shrink


def test_colours_at_texels_between_them_and_beyond_the_edges(rng: np.random.Generator) -> None:
    image = rng.random((4, 6, 3))
    row, column = np.mgrid[0:4, 0:6].reshape(2, -1)
    uv = np.stack([(column + 0.5) / 6, 1 - (row + 0.5) / 4], 1)
    for repeated in (uv, np.add(uv, [1, -2])):
        np.testing.assert_allclose(bilinear(image, repeated), image.reshape(-1, 3), atol=1e-12)
    beside = (image + np.roll(image, -1, 1)) / 2
    np.testing.assert_allclose(bilinear(image, np.add(uv, [1 / 12, 0])), beside.reshape(-1, 3))
    above = (image + np.roll(image, 1, 0)) / 2
    np.testing.assert_allclose(bilinear(image, np.add(uv, [0, 1 / 8])), above.reshape(-1, 3))


def test_a_smaller_picture_has_the_means_of_its_blocks(rng: np.random.Generator) -> None:
    small = rng.random((5, 7, 3))
    large = small.repeat(3, 0).repeat(3, 1)
    large[::3] += 0.3  # the other two rows of each block make up for it
    large[1::3] -= 0.3
    np.testing.assert_allclose(shrink(large, 3), small)
