"""What loads at its first use."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.core import linalg
from tests.support import shapes
from tests.support.command_line import obj
from tests.support.processes import printed

PUT_OFF = """
import sys
from circparam.core.imports import UNUSED, OnDemand, put_off
put_off()
import numpy as np
from circparam.core import compiled, fourier, linalg
from circparam.core.linear_program import INTERIOR, least
from circparam.core.graph import components
import scipy.sparse as sps
matrix = sps.csc_matrix(np.diag([2.0, 4.0]))
print(linalg.Factor(matrix).solve(np.array([2.0, 4.0])), compiled.kd_tree(np.eye(2)).query([[1, 0.1]])[1])
print(components(3, np.array([0]), np.array([2])), fourier.rfft2(np.ones((2, 2)))[0, 0])
print(least(-np.ones(2), matrix, np.ones(2), 1.0, INTERIOR))
late = ("scipy.linalg", "scipy.special", "scipy.sparse.linalg._isolve", "scipy.spatial._kdtree")
late += ("scipy.fft._basic", "scipy.sparse.csgraph._laplacian", "numpy.ma.core")
inner = [name for name in sys.modules if name.startswith(tuple(u + "." for u in UNUSED))]
print([*inner, *(name for name in late if name in sys.modules)])
from numpy.testing import assert_array_equal
assert_array_equal(np.arange(3), [0, 1, 2])
assert np.f2py.__version__ and np.ma.masked is not None
put_off()
assert "numpy.testing._private" in sys.modules and callable(np.testing.assert_allclose)
fft = OnDemand("scipy.fft")
assert "scipy.fft" not in sys.modules
assert fft.next_fast_len(13, real=True) == 15
assert fft.rfft2 is sys.modules["scipy.fft"].rfft2
from scipy.sparse.linalg import eigsh, splu
from scipy.sparse.csgraph import laplacian
import scipy.spatial, scipy.optimize, scipy.interpolate, scipy.ndimage
assert (splu(matrix).solve(np.ones(2)) == linalg.Factor(matrix).solve(np.ones(2))).all()
assert len(scipy.spatial.ConvexHull(np.random.rand(9, 2)).simplices) >= 3
assert scipy.fft.rfft2(np.ones((2, 2)))[0, 0] == 4
assert scipy.optimize.linprog([1.0], bounds=(0, 1)).x[0] == 0
assert isinstance(compiled.kd_tree(np.eye(2)), scipy.spatial.cKDTree)
"""


def test_what_nobody_uses_is_not_loaded_and_works_when_it_is() -> None:
    """Compiled functions load alone, and their packages work afterwards."""
    lines = printed(PUT_OFF).splitlines()
    assert lines[:2] == ["[1. 1.] [0]", "(2, array([0, 1, 0])) (4+0j)"]
    assert lines[2:] == ["[0.5  0.25]", "[]"]


UNWRAP = """
import sys
from circparam.cli import main
sys.argv = ["circparam", "unwrap", *sys.argv[1:], "--quiet", "-j2"]
try:
    main()
except SystemExit as end:
    assert not end.code
wanted = {"numpy.testing._private", "numpy.f2py.crackfortran"}
wanted |= {"scipy.spatial", "scipy.ndimage", "scipy.optimize", "scipy.special", "scipy.fft._pocketfft"}
wanted |= {"scipy.interpolate", "scipy.stats", "scipy.integrate", "scipy.signal", "fast_simplification"}
wanted |= {"multiprocessing", "loky", "trimesh", "PIL", "rich", "dask", "fsspec", "jinja2", "email", "asyncio"}
wanted |= {"psutil", *["circparam.packing.nest.search"] * ("--no-normalize" in sys.argv)}
rooms = tuple(f"circparam.{room}" for room in ("maps", "render", "bake", "batch", "compare"))
wanted |= {name for name in sys.modules if name.startswith(rooms)}
print(sorted(wanted & set(sys.modules)))
"""


@pytest.mark.parametrize("page", ["--pack-splits=0", "--no-normalize"])
def test_a_mesh_of_one_chart_loads_nothing_that_only_others_need(page, tmp_path: Path) -> None:
    points, faces = shapes.delaunay_square(200)
    points = np.c_[points[:, :2], 0.1 * (points[:, :2] ** 2).sum(1)]
    mesh = obj(tmp_path / "dome.obj", (points, faces))
    assert printed(UNWRAP, mesh, "-o", tmp_path / "out.obj", page).splitlines()[-1] == "[]"


ELSEWHERE = """
import importlib

found = importlib.import_module

def found_elsewhere(name, package=None):
    if name.startswith("scipy.") and "._" in name:
        raise ModuleNotFoundError(name)
    return found(name, package)

importlib.import_module = found_elsewhere
import circparam
from circparam.core import linalg
from tests.core.test_imports import measures
assert linalg.gstrf is None
print(measures())
"""


def measures() -> list[tuple[str, object]]:
    """What is measured of a small unwrap."""
    ball = shapes.noisy(*shapes.icosphere(1), amount=0.1)
    result = circparam.unwrap(ball, jobs=1, resolution=256, effort=0.02)
    return sorted(result.measures.items())


def test_a_scipy_whose_private_modules_are_elsewhere_gives_the_same() -> None:
    assert linalg.gstrf is not None
    assert printed(ELSEWHERE) == f"{measures()}\n"
