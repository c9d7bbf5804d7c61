"""Files of gigabytes that are cut short, and memory that ends at any step: one line, the code, nothing left."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.support import shapes
from tests.support.command_line import obj
from tests.support.ply_files import head_of_promises

resource = pytest.importorskip("resource")
STEPS = 20
LIMITED = (
    "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]),) * 2); "
    "from circparam.__main__ import main; sys.argv[:] = ['circparam', *sys.argv[2:]]; main()"
)


def run(limit: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", LIMITED, str(limit), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=env)


def large_ply(path: Path, vertices: int, faces: int, size: int) -> None:
    """The head of a mesh of gigabytes, a thousand rows of it, and a size: the rest is a hole in the file."""
    points = np.random.default_rng(0).normal(size=(1000, 3)).astype("<f4")
    path.write_bytes(head_of_promises(vertices, faces) + points.tobytes())
    os.truncate(path, size)


@pytest.mark.slow
@pytest.mark.parametrize("enough", [True, False])
def test_four_gigabytes_cut_short(tmp_path: Path, enough: bool) -> None:
    """With the memory to read it, what is missing is told; without, how large it is."""
    path, out = tmp_path / "large.ply", tmp_path / "out.ply"
    large_ply(path, 100_000_000, 400_000_000, 4 << 30)
    stamp = path.stat().st_mtime_ns
    done = run((8 if enough else 2) << 30, "unwrap", str(path), "-o", str(out))
    assert done.returncode == 3, done.stderr
    line = done.stderr.strip()
    assert "\n" not in line
    assert ("not filled to its end" if enough else "4.3 GB are more memory than there is") in line
    assert sorted(os.listdir(tmp_path)) == ["large.ply"]
    assert path.stat().st_mtime_ns == stamp


@pytest.mark.slow
def test_memory_that_ends_at_any_step(tmp_path: Path) -> None:
    """From what the libraries take to what the mesh takes: a line and its code, or the whole file."""
    shape = shapes.noisy(*shapes.torus(128, 50), amount=0.002)
    path = obj(tmp_path / "in.obj", shape)
    before, codes = path.read_bytes(), []
    for limit in np.linspace(300e6, 900e6, STEPS).astype(int):
        done = run(int(limit), "unwrap", str(path), "-o", str(tmp_path / "out.ply"), "--overwrite")
        codes.append(done.returncode)
        assert done.returncode in (0, 3, 5), (int(limit), done.stderr)
        assert "Traceback" not in done.stderr, done.stderr
        left = {"in.obj"} | ({"out.ply"} if done.returncode == 0 else set())
        assert set(os.listdir(tmp_path)) == left, (int(limit), done.stderr)
        if done.returncode == 0:
            (tmp_path / "out.ply").unlink()
        else:
            assert len(done.stderr.strip().splitlines()) == 1, done.stderr
        assert path.read_bytes() == before
    assert codes[-1] == 0
    assert 5 in codes
