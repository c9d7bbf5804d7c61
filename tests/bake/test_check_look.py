"""How alike two pictures are: known answers of both figures."""

import numpy as np
import pytest

from circparam.bake.check_look import EQUAL_PSNR_DB, psnr, ssim


def test_equal_pictures_and_a_shift(rng: np.random.Generator) -> None:
    picture = 0.5 * rng.random((64, 64, 3))
    assert psnr(picture, picture) == EQUAL_PSNR_DB
    assert psnr(picture, picture + 0.1) == pytest.approx(20)
    assert ssim(picture, picture) == pytest.approx(1)


def test_structure_is_mean_contrast_and_correlation() -> None:
    """Of flat pictures the means decide; of a stripe and its negative the correlation is −1."""
    flat = [np.full((32, 32, 3), value) for value in (0.2, 0.6)]
    assert ssim(*flat) == pytest.approx((2 * 0.2 * 0.6 + 1e-4) / (0.2**2 + 0.6**2 + 1e-4))
    stripes = np.tile(np.arange(64) % 2, (64, 1))[..., None] * np.ones(3)
    assert ssim(stripes, 1 - stripes) < -0.99
    weak = 0.5 + (stripes - 0.5) / 3  # contrasts c and 3 c: 2 · 3 / (1 + 9)
    assert ssim(stripes, weak) == pytest.approx(0.6, abs=0.01)
