"""Work that has nothing to show is broken off at its last moment, wherever it is."""

import time

import numpy as np
import pytest
import scipy.sparse as sps

from circparam.core import clock, graph
from circparam.core.linalg import Factor
from circparam.errors import OutOfTimeError

ONE = np.zeros(1, np.int64)
WORK = {
    "factor": lambda: Factor(sps.eye_array(3, format="csc")),
    "components": lambda: graph.components(2, ONE, ONE + 1),
    "matching": lambda: graph.matching(np.ones(1), ONE, ONE + 1, 2),
}


@pytest.mark.parametrize("name", WORK)
def test_building_blocks_look_at_the_clock(name: str) -> None:
    WORK[name]()
    with clock.bounded(None):
        WORK[name]()
    with clock.bounded(time.monotonic() + 1e6):
        WORK[name]()
        with pytest.raises(OutOfTimeError, match="--timeout"), clock.bounded(0.0):
            WORK[name]()
        WORK[name]()
    WORK[name]()


def test_what_is_left() -> None:
    assert clock.left() is None
    with clock.bounded(time.monotonic() + 100):
        rest = clock.left()
        assert 0 < rest <= 100
    assert clock.left() is None
