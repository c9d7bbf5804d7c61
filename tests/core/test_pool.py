"""Worker processes end with whoever opened them."""

import sys
import time

from circparam.core import pool

RESULT_BYTES = 300_000_000  # long enough on its way to be cut short
PATIENCE = 60.0  # seconds, a bound against hangs


def functions_of(thread: int) -> set[str]:
    """Names of the functions that a thread is in."""
    frame, names = sys._current_frames().get(thread), set()
    while frame is not None:
        names.add(frame.f_code.co_name)
        frame = frame.f_back
    return names


def test_a_result_that_is_cut_short_keeps_no_program_from_ending() -> None:
    """A process is killed while it sends: the thread that receives must not wait for the rest."""
    pool.stop()
    pool.start(2)
    opened = pool.current()
    opened.ready.result()
    opened.executor.submit(bytes, RESULT_BYTES)
    receiver = opened.executor._executor_manager_thread
    end = time.monotonic() + PATIENCE
    while "_recv" not in functions_of(receiver.ident):
        assert time.monotonic() < end
    pool.stop()
    receiver.join(PATIENCE)
    assert not receiver.is_alive()
