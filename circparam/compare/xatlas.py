"""xatlas as a baseline: the only importer of a package that circparam itself never needs.

Two rows: ``xatlas`` with settings that mirror no chart, and ``xatlas-default`` as its users get it.
"""

from __future__ import annotations

import importlib.util
import time
from typing import Any

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.mesh import UVMap

NAMES = ("xatlas", "xatlas-default")


def require() -> None:
    """Raise OptionError where xatlas is not installed."""
    if importlib.util.find_spec("xatlas") is None:
        raise OptionError("xatlas is not installed: pip install 'circparam[baseline]'")


def atlas(
    points: FloatArray, faces: IntArray, name: str = "xatlas"
) -> tuple[UVMap, dict[str, float]]:
    """An atlas by xatlas (Young, 2018): (layout over the faces, seconds).

    points: (n, 3), faces: (m, 3). Its pages are not square and its uv are normalised for each axis; that is
    undone, so the layout lies in the unit square undistorted. It works in float32 and drops degenerate faces
    (uv_faces −1). Raises OptionError where xatlas is not installed.
    """
    require()
    import xatlas

    work = xatlas.Atlas()
    start = time.perf_counter()
    work.add_mesh(points.astype(np.float32), faces.astype(np.uint32))
    if name == "xatlas-default":
        work.generate()
    else:
        charts, pages = xatlas.ChartOptions(), xatlas.PackOptions()
        charts.fix_winding = True
        pages.rotate_charts = False
        work.generate(charts, pages)
    _, index, uv = work.get_mesh(0)
    seconds = {"atlas": time.perf_counter() - start}
    size = np.array([work.width, work.height], np.float64)
    uv = np.asarray(uv, np.float64) * size / max(size.max(), 1.0)
    return UVMap(uv, np.asarray(index).astype(np.int64).reshape(-1, 3)), seconds


def task(arrays: dict[str, Any], settings: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """``atlas`` as a task for ``circparam.compare.process``."""
    uvmap, seconds = atlas(arrays["points"], arrays["faces"], settings["method"])
    return {"uv": uvmap.uv, "uv_faces": uvmap.uv_faces}, {"stages": seconds}
