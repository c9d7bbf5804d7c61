"""The baselines: their layouts are undistorted by their pages, and nobody needs them."""

import numpy as np
import pytest

from circparam import errors
from circparam.compare.baselines import BASELINES, atlas
from tests.support import shapes


@pytest.mark.parametrize("name", BASELINES)
def test_without_it_the_cure_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(errors.OptionError, match=f"{name.split('-')[0]} is not installed: pip"):
        atlas(*shapes.triangle(), name)


@pytest.mark.parametrize("name", BASELINES)
def test_its_page_is_undone(name: str) -> None:
    """A flat strip comes back as a strip: angles and the ratio of its sides are kept."""
    pytest.importorskip(name.split("-")[0])
    points, faces = shapes.grid(9, 3)
    points = points * [4, 1, 1]
    uvmap, seconds = atlas(points, faces, name)
    assert seconds["atlas"] > 0
    assert uvmap.uv.min() >= 0
    assert uvmap.uv.max() <= 1
    assert len(uvmap.uv_faces) == len(faces)
    flat = uvmap.uv[uvmap.uv_faces]
    length = np.linalg.norm(flat - flat[:, [1, 2, 0]], axis=2)
    before = np.linalg.norm(points[faces] - points[faces][:, [1, 2, 0]], axis=2)
    ratio = length / before
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=1e-3)
