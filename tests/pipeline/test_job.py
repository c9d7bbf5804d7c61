"""What all stages share: the repaired surface, and layouts for every face of the file."""

from __future__ import annotations

import numpy as np
import pytest

from circparam import errors
from circparam.core.monitor import Monitor
from circparam.errors import OutOfTimeError
from circparam.formats.memory import from_arrays
from circparam.pipeline.job import prepare
from circparam.pipeline.options import Options
from tests.support import shapes


def test_faces_set_aside_get_uv_and_numbers_are_those_of_the_format() -> None:
    p, f = shapes.grid(4, 4)
    f = np.r_[f, f[2:3], [[0, 0, 1]]]
    document = from_arrays(p, f)
    for name, exact in (("glb", False), ("obj", True)):
        job = prepare(document, None, Options(format=name), Monitor())
        assert job.target == name
        assert job.tiles is None
        assert len(job.surface.faces) == len(f) - 2
        cut_mesh = job.surface.cut_mesh(np.zeros(len(job.surface.edges), bool))
        uv = np.random.default_rng(0).random((cut_mesh.n_vertices, 2))
        whole = job.completed(cut_mesh, uv)
        assert whole.uv_faces.shape == f.shape
        np.testing.assert_array_equal(whole.uv, uv)
        stored = job.stored(cut_mesh, uv)
        assert np.array_equal(stored.uv, uv) == exact
        np.testing.assert_allclose(stored.uv[stored.uv_faces], uv[whole.uv_faces], atol=1e-6)


def test_a_deadline_and_refused_repairs_end_it_at_once() -> None:
    with pytest.raises(OutOfTimeError, match="--timeout"):
        prepare(from_arrays(*shapes.grid()), None, Options(), Monitor(timeout=-1.0))
    with pytest.raises(errors.TopologyError, match="non-manifold"):
        prepare(from_arrays(*shapes.fins(3)), None, Options(repair=False), Monitor())
