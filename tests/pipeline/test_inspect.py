"""A look at a mesh: what it is, what its uv are worth, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from circparam import errors, samples
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import Mesh, UVMap
from circparam.mesh.repair import repair
from circparam.pipeline.inspect import inspect, require_disks
from circparam.pipeline.verify import verify
from tests.cli.test_check import with_uv
from tests.support import shapes


def test_without_a_set_nothing_is_judged() -> None:
    found = inspect(from_arrays(*shapes.torus(6, 5)))
    assert (found.uv, found.uv_sets, found.faults) == (None, (), [])


def test_faults_of_a_set(tmp_path: Path) -> None:
    p, f = shapes.grid(5, 5)
    good = read(with_uv(tmp_path / "a.obj", p[:, :2] * 0.8 + 0.1, (p, f)))
    found = inspect(good, uv_set=0, resolution=64, padding=4)
    assert found.uv is not None
    assert found.uv.valid
    assert found.faults == []
    near = read(with_uv(tmp_path / "b.obj", p[:, :2] * 0.98 + 0.01, (p, f)))
    assert inspect(
        near, uv_set=0, resolution=64, padding=4
    ).faults  # nearer to the edge than 4 texels
    assert not inspect(near, uv_set=0, resolution=64, padding=0).faults


@pytest.mark.parametrize("number", [1, 7])
def test_a_set_that_is_not_there(number: int) -> None:
    with pytest.raises(errors.InputError, match=rf"no uv set {number} \(there is 0\)"):
        inspect(read(samples.path("vase")), uv_set=number)


@pytest.mark.parametrize("keywords", [{"resolution": 0}, {"resolution": 16385}, {"padding": -1}])
def test_pages_that_do_not_exist(keywords: dict[str, int]) -> None:
    with pytest.raises(errors.OptionError, match=f"--{next(iter(keywords))}"):
        inspect(read(samples.path("vase")), uv_set=0, **keywords)  # type: ignore[arg-type]


def test_charts_hang_together_as_the_layout_shows_them() -> None:
    """Four sheets at one line: straight ahead lies the third, in the layout the next one."""
    n = 4
    k, t, r = (a.ravel() for a in np.meshgrid(range(4), range(n), range(3), indexing="ij"))
    angle = k * np.pi / 2
    p = np.stack([r * np.cos(angle), r * np.sin(angle), 1.0 * t], 1)
    p[r == 0, :2] = 0
    a, b = (x.ravel() for x in np.meshgrid(range(n - 1), range(2), indexing="ij"))
    i = (np.arange(4)[:, None] * 3 * n + a * 3 + b).ravel()
    f = np.concatenate([np.c_[i, i + 3, i + 1], np.c_[i + 1, i + 3, i + 4]])
    f = np.where(np.isin(f[:, :1] // (3 * n), (1, 2)), f[:, ::-1], f)  # 0 fits 1 and 2, 3 fits both
    side, page = np.where(np.isin(k, (1, 2)), 1, -1), k // 2
    uv = np.stack([r * side + 2 + 5 * page, 1.0 * t], 1) / 10 + 0.02
    mesh = Mesh(p, f)
    by_angle = verify(repair(mesh)[0], UVMap(uv, f))
    assert by_angle.numbers()["charts"] == 4
    found = inspect(from_arrays(p, f, uv=uv, uv_faces=f), uv_set=0, resolution=64, padding=0)
    assert found.uv is not None
    assert (found.uv.numbers()["charts"], found.uv.flips, found.uv.overlap) == (2, 0, 0)
    assert found.uv.numbers()["seam_length"] == 0


def test_disks() -> None:
    require_disks(inspect(from_arrays(*shapes.grid(3, 3))))
    mixed = shapes.join(shapes.grid(3, 3), shapes.torus(6, 5), shapes.icosphere(0))
    with pytest.raises(errors.TopologyError, match=r"component 1 is .*genus 1.*\(2 components are"):
        require_disks(inspect(from_arrays(*mixed)))
    one = shapes.join(shapes.icosphere(0), shapes.grid(3, 3))
    with pytest.raises(errors.TopologyError, match=r"component 0 is .*not a disk: cut it"):
        require_disks(inspect(from_arrays(*one)))
