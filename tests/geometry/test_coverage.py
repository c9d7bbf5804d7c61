"""Rasters from the boundary alone, against brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.geometry.coverage import cover, label_grid, pages_of
from circparam.mesh.cut_mesh import CutMesh
from tests.support import shapes
from tests.support.charts import flat_of
from tests.support.packing import covered


def squares(corners: list[tuple[float, float]], size: float) -> tuple[CutMesh, np.ndarray]:
    """Axis-aligned squares of one size in the unit square, one chart each."""
    base, f = shapes.grid(3, 3)
    parts = [(base * size + [x, y, 0], f) for x, y in corners]
    return flat_of(shapes.join(*parts))


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.integers(8, 60), st.booleans())
def test_the_boundary_alone_tells_what_faces_cover(seed: int, resolution: int, fold: bool) -> None:
    """And the edges along which a chart is folded over itself."""
    p, f = shapes.delaunay_disk(40, seed % 1000)
    rng = np.random.default_rng(seed)
    p = p * 0.3 + [0.5, 0.5, 0] + [*rng.uniform(-0.1, 0.1, 2), 0]
    cut_mesh, uv = flat_of((p, f))
    if fold:
        uv[:, 0] = np.abs(uv[:, 0] - 0.5) + 0.3
    got = label_grid(cut_mesh, uv, resolution) >= 0
    # centres that lie on a boundary to the last digit may fall on either side
    assert (got != (covered(cut_mesh.faces, uv, cut_mesh.chart, resolution)[0] >= 0)).sum() <= 2


def test_pages_are_tiles() -> None:
    cut_mesh, uv = squares([(0.1, 0.1), (1.1, 0.1), (2.5, 0.5)], 0.2)
    assert pages_of(cut_mesh, uv).tolist() == [0, 1, 2]
    found = cover(cut_mesh, uv, 50, 4)
    assert found.share == pytest.approx(0.04, abs=0.005)
    assert found.border == 5
