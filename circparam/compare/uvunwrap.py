"""uvunwrap as a baseline: the only importer of a package that circparam itself never needs."""

from __future__ import annotations

import importlib.util
import time
from typing import Any

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.mesh import UVMap

NAMES = ("uvunwrap",)
PAGE = 2048  # texels a side, and the padding below: the defaults of circparam
PADDING = 4


def require() -> None:
    """Raise OptionError where uvunwrap is not installed."""
    if importlib.util.find_spec("uvunwrap") is None:
        raise OptionError("uvunwrap is not installed: pip install 'circparam[baseline]'")


def atlas(
    points: FloatArray, faces: IntArray, name: str = "uvunwrap"
) -> tuple[UVMap, dict[str, float]]:
    """An atlas by uvunwrap (2025, MIT): (layout over the faces, seconds).

    points: (n, 3), faces: (m, 3). Its pages are not square and its uv are normalised for each axis; that is
    undone, so the layout lies in the unit square undistorted, further pages to the right of it. It works in
    float32; faces without a chart have uv_faces −1. name: as for other baselines; there is one setting.
    Raises OptionError where uvunwrap is not installed.
    """
    require()
    import uvunwrap

    start = time.perf_counter()
    mesh = uvunwrap.Mesh(points.astype(np.float32), faces.astype(np.uint32))
    work = uvunwrap.generate([mesh], page_size=PAGE, padding=PADDING)
    seconds = {"atlas": time.perf_counter() - start}
    found = work.meshes[0]
    size = np.array([work.width, work.height], np.float64)
    uv = np.asarray(found.uv, np.float64).reshape(-1, 2) * size / max(size.max(), 1.0)
    page = np.asarray(found.page, np.int64)
    uv[:, 0] += np.maximum(page, 0)
    index = np.asarray(found.indices, np.int64).reshape(-1, 3)
    index[(page[index] < 0).any(1)] = -1
    return UVMap(uv, index), seconds


def task(arrays: dict[str, Any], settings: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """``atlas`` as a task for ``circparam.compare.process``."""
    uvmap, seconds = atlas(arrays["points"], arrays["faces"], settings["method"])
    return {"uv": uvmap.uv, "uv_faces": uvmap.uv_faces}, {"stages": seconds}
