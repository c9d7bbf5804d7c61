"""The whole way as a library: what goes in stays as it is, what comes out is verified."""

import numpy as np
import pytest
import trimesh

import circparam
from circparam import errors
from circparam.formats.memory import from_arrays
from tests.support import shapes

QUICK = {"effort": 0.01}


def test_inputs_are_untouched() -> None:
    p, f = shapes.join(shapes.fins(3), shapes.icosphere(1))
    tm = trimesh.Trimesh(p, f, process=False)
    before = p.copy(), f.copy(), tm.vertices.copy(), tm.faces.copy()
    circparam.unwrap((p, f), **QUICK)
    circparam.unwrap(tm, **QUICK)
    for a, b in zip(before, (p, f, tm.vertices, tm.faces), strict=True):
        np.testing.assert_array_equal(a, b)


def test_every_face_has_uv_and_a_chart() -> None:
    """Duplicates, degenerate and turned faces included; what was set aside has no chart of its own."""
    p, f = shapes.cube(2)
    f = np.r_[f, f[3:4], [[0, 0, 1]], f[5:6, ::-1]]
    f[7] = f[7, ::-1]
    result = circparam.unwrap((p, f), **QUICK)
    assert result.uv_faces.shape == f.shape
    assert result.uv_faces.min() >= 0
    assert np.isfinite(result.uv).all()
    assert (result.charts < 0).sum() == 3
    assert result.status == "repaired"
    assert any("duplicate" in line for line in result.repairs)
    corner = dict(zip(f[3], result.uv[result.uv_faces[3]], strict=True))
    for v, uv in zip(f[-3], result.uv[result.uv_faces[-3]], strict=True):
        np.testing.assert_array_equal(uv, corner[v])


def test_repack_keeps_charts() -> None:
    p, f = shapes.row_of(shapes.grid(5, 5), 2)
    document = from_arrays(p, f, p[:, :2])
    result = circparam.repack(document, **QUICK)
    assert result.measures["charts"] == 2
    assert result.verification.valid
    with pytest.raises(errors.InputError, match="no uv"):
        circparam.repack((p, f))
    for kept in ({"normalize": False}, {"pins": {0: (0.0, 0.0)}}):
        with pytest.raises(errors.OptionError, match="leave normalize and pins out"):
            circparam.repack(document, **kept)
