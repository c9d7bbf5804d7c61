"""Memory as the system tells it: more where more is held, nothing of a process that is not there."""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest

from circparam.core.memory import address_space, resident


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc is there on Linux alone")
def test_what_is_held_counts() -> None:
    before, room = resident(), address_space()
    held = np.ones(8_000_000)
    assert resident(os.getpid()) - before > 0.8 * held.nbytes
    assert address_space() - room > 0.8 * held.nbytes
    assert resident() <= address_space()


def test_a_process_that_is_not_there_holds_nothing() -> None:
    assert resident(2**30) == 0 == address_space(2**30)
