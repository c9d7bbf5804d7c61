"""Layouts that several tests read, each computed once in a process."""

import hashlib
import pickle
from typing import Any

import numpy as np

from circparam import samples
from circparam.pipeline.result import Result
from circparam.pipeline.unwrap import unwrap
from circparam.seams.cost import COST
from tests.support.shapes import Shape

QUICK = {"effort": 0.01, "jobs": 1}  # the guarantees hold after any amount of search
_RESULTS: dict[bytes, Result] = {}


def unwrapped(source: str | Shape, **options: Any) -> Result:
    """``unwrap`` of a sample by name, or of (points (n, 3), faces (m, 3)), in memory.

    Tests share the result: they may read it only, and its arrays raise on writing. A test that asks for a
    second computation, for a file or for a listener calls ``unwrap`` itself.
    """
    key = hashlib.sha256(pickle.dumps((source, sorted(options.items())))).digest()
    if key not in _RESULTS:
        result = unwrap(samples.path(source) if isinstance(source, str) else source, **options)
        for array in (result.uv, result.uv_faces, result.charts, result.tiles):
            if isinstance(array, np.ndarray):
                array.setflags(write=False)
        _RESULTS[key] = result
    return _RESULTS[key]


def cost(result: Result) -> float:
    """What a layout costs as it was verified."""
    m: dict[str, Any] = result.measures
    return COST.finished(
        m["seam_length"], m["charts"], m["distortion"], m["share_over_2"], m["pack"]
    )
