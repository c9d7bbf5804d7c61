"""Worker processes end with whoever opened them."""

import subprocess
import sys

import pytest

CUT_SHORT = """
import sys, time
from circparam.core import pool
pool.start(2)
pool.current().ready.result()
pool.current().executor.submit(bytes, 300_000_000)
time.sleep(float(sys.argv[1]))
pool.stop()
"""


@pytest.mark.parametrize("seconds", ["0.02", "0.1", "0.2"])
def test_a_result_that_is_cut_short_keeps_no_program_from_ending(seconds: str) -> None:
    """A process is killed while it sends: the thread that receives must not wait for the rest."""
    subprocess.run([sys.executable, "-c", CUT_SHORT, seconds], check=True, timeout=60)
