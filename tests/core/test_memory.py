"""Memory as the system tells it: more where more is held, nothing of a process that is not there."""

from __future__ import annotations

import mmap
import os
import sys

import pytest

from circparam.core.memory import address_space, resident


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc is there on Linux alone")
def test_what_is_held_counts() -> None:
    before, room = resident(), address_space()
    size = 64_000_000
    with mmap.mmap(-1, size) as held:  # from the system: an allocator may have as much left over
        held.write(b"x" * size)
        assert resident(os.getpid()) - before > 0.8 * size
        assert address_space() - room > 0.8 * size
    assert resident() <= address_space()


def test_a_process_that_is_not_there_holds_nothing() -> None:
    assert resident(2**30) == 0 == address_space(2**30)
