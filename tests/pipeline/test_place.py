"""Charts at one texel density, packed, or side by side."""

from pathlib import Path

import numpy as np

import circparam
from circparam.formats import write
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import UVMap
from tests.support import shapes

QUICK = {"effort": 0.01}


def test_no_normalize_keeps_the_solver_coordinates() -> None:
    p, f = shapes.grid(6, 6)
    result = circparam.unwrap((p * 7, f), cut="none", method="isometric", normalize=False)
    q = result.uv[result.uv_faces]
    s = (p * 7)[f]
    np.testing.assert_allclose(
        np.linalg.norm(q[:, 1] - q[:, 0], axis=1),
        np.linalg.norm(s[:, 1] - s[:, 0], axis=1),
        rtol=1e-4,  # the energy is at its minimum to 1e-6, so lengths are to about its root
    )
    assert result.measures["pack"] is None


def test_charts_of_a_lightmap_cross_materials(tmp_path: Path) -> None:
    """One image shows the light of all materials; elsewhere a chart ends with its material."""
    p, f = shapes.grid(6, 6)
    path = tmp_path / "two.glb"
    document = from_arrays(p, f, groups=(p[f].mean(1)[:, 0] > p[:, 0].mean()).astype(np.int64))
    write(path, document, UVMap(p[:, :2], f))
    for given, charts in (({}, 2), ({"lightmap": True}, 1)):
        made = circparam.unwrap(path, **given, **QUICK)
        assert made.measures["charts"] == charts
    cut = circparam.unwrap(path, lightmap=True, cut_materials=True, **QUICK)
    assert cut.measures["charts"] == 2
