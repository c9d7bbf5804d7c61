"""Memory as the system tells it: more where more is held, nothing of a process that is not there."""

import mmap
import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from circparam.core.memory import address_space, keeping_freed, resident
from tests.support.processes import ROOT, printed


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc is there on Linux alone")
def test_what_is_held_counts() -> None:
    before, room = resident(), address_space()
    size = 64_000_000
    with mmap.mmap(-1, size) as held:  # from the system: an allocator may have as much left over
        held.write(b"x" * size)
        assert resident(os.getpid()) - before > 0.8 * size
        assert address_space() - room > 0.8 * size
    assert resident() <= address_space()
    assert resident(2**30) == 0 == address_space(2**30), "of a process that is not there"


def faults(size: int, times: int) -> int:
    """Pages that the system had to give while arrays of so many bytes came and went."""
    import resource

    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(times):
        np.ones(size, np.uint8)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="mallopt is glibc's")
def test_arrays_that_were_freed_serve_the_next_ones_and_go_back_to_the_system_at_the_end() -> None:
    # In a process of its own: once a thread was refused memory, glibc serves it from another arena, where
    # mallopt has no say; other tests ask for more than there is.
    code = "from tests.core.test_memory import arrays_come_and_go as check; check()"
    printed(code)


def arrays_come_and_go() -> None:
    size = 200_000_000
    outside = faults(size, 4)
    with keeping_freed():
        faults(size, 1)
        assert faults(size, 4) < outside / 10
        held = resident()
        with keeping_freed(False):
            assert faults(size, 4) < outside / 10, "not worth it: as it was"
    assert held - resident() > 0.8 * size
    assert faults(size, 4) > outside / 2


needs_bounds = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="address spaces are bounded on Linux alone"
)


@needs_bounds
def test_products_need_no_more_memory_once_their_work_space_is_claimed() -> None:
    code = """
import resource
import numpy as np
from scipy.linalg import blas
from circparam.core.memory import address_space, claim_work_space
square = np.ones((300, 300))
claim_work_space()
bound = address_space() + 8_000_000
resource.setrlimit(resource.RLIMIT_AS, (bound, bound))
assert np.allclose(np.dot(square, square), 300)
assert np.allclose(blas.dgemm(1.0, square, square), 300)
"""
    printed(code)


@needs_bounds
@pytest.mark.parametrize(
    ("words", "code"), [(["unwrap", "mesh.obj"], 5), (["methods"], 5), (["--help"], 0)]
)
def test_a_bound_below_what_the_libraries_take_is_refused_at_once(words, code):
    program = "import resource; resource.setrlimit(resource.RLIMIT_AS, (300_000_000,) * 2)"
    program += "; from circparam.cli.group import main; main()"
    how = {"cwd": ROOT, "capture_output": True, "text": True, "timeout": 120}
    run = subprocess.run([sys.executable, "-c", program, *words], **how)
    assert run.returncode == code
    assert ("the libraries alone take" in run.stderr) == (run.stderr.count("\n") == 1) == bool(code)
