"""What loads at its first use."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys
from circparam.core.imports import UNUSED, put_off
put_off()
import scipy.sparse
inner = [name for name in sys.modules if name.startswith(tuple(u + "." for u in UNUSED))]
assert not inner, inner
import numpy
from numpy.testing import assert_array_equal
assert_array_equal(numpy.arange(3), [0, 1, 2])
assert numpy.f2py.__version__
put_off()
assert "numpy.testing._private" in sys.modules
assert callable(numpy.testing.assert_allclose)
"""


def test_what_nobody_uses_is_not_loaded_and_works_when_it_is() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
