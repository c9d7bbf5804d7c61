"""The words of all packers: a row is called with a task and says what it wants."""

from __future__ import annotations

import numpy as np

from circparam.core.monitor import Monitor
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.placement import Packer, PackTask, Placement, always
from tests.support.packing import blobs


def test_a_packer_is_its_function_and_applies_unless_it_says_otherwise() -> None:
    shapes, options = shapes_of(*blobs(3, 0)), PackOptions(64)
    placement = Placement(2.0, np.zeros(3), np.zeros((3, 2)), np.zeros(3, np.int64))
    asked = []

    def place(task: PackTask) -> Placement | None:
        asked.append(task)
        return task.found.get("before")

    packer = Packer(place)
    task = PackTask(shapes, options, Monitor(), {"before": placement}, lambda found: True)
    assert packer(task) is placement
    assert asked == [task]
    assert packer(PackTask(shapes, options, Monitor(), {}, lambda found: True)) is None
    assert packer.applies(shapes, options) is always(shapes, options) is True
    assert (packer.instant, packer.fallback) == (False, False)
