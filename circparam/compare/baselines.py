"""Baselines: atlases of other packages, which circparam itself never needs.

``xatlas`` has settings that mirror no chart, ``xatlas-default`` the settings of its users; ``uvunwrap`` has one
setting.
"""

import importlib.util
import time
from typing import Any, TypeAlias

import numpy as np

from circparam.core.own_process import Arrays
from circparam.core.types import FloatArray
from circparam.errors import OptionError

BASELINES = {"xatlas": "xatlas", "xatlas-default": "xatlas", "uvunwrap": "uvunwrap"}  # → package
# texels of uvunwrap's page and between charts: the defaults of circparam
PAGE_TEXELS, PADDING_TEXELS = 2048, 4

# uv (k, 2) over (width, height), their faces (m, 3), page of each uv
_Made: TypeAlias = tuple[Any, Any, Any]


def require(name: str) -> None:
    """Raise OptionError if the package of a baseline is not installed."""
    package = BASELINES[name]
    if importlib.util.find_spec(package) is None:
        raise OptionError(f"{package} is not installed: pip install 'circparam[baseline]'")


def task(arrays: Arrays, settings: dict[str, Any]) -> tuple[Arrays, dict[str, Any]]:
    """An atlas by a baseline, as a task for ``circparam.core.own_process``.

    arrays: points (n, 3), faces (m, 3). settings: method, the name of the baseline. Returns uv and uv_faces,
    and seconds under ``stages``. The packages work in float32 and normalise uv for each axis of their page. The
    layout here lies undistorted in the unit square, and further pages lie to the right. Faces without a chart
    have uv_faces −1. Raises OptionError if the package is not installed.
    """
    name = settings["method"]
    require(name)
    mesh = arrays["points"].astype(np.float32), arrays["faces"].astype(np.uint32)
    start = time.perf_counter()
    size, (uv, index, page) = (_by_uvunwrap if name == "uvunwrap" else _by_xatlas)(*mesh, name)
    seconds = {"atlas": time.perf_counter() - start}
    uv = np.asarray(uv, np.float64).reshape(-1, 2) * size / max(size.max(), 1.0)
    uv[:, 0] += np.maximum(page, 0)
    index = np.asarray(index).astype(np.int64).reshape(-1, 3)
    index[(page[index] < 0).any(1)] = -1
    return {"uv": uv, "uv_faces": index}, {"stages": seconds}


def _by_xatlas(points: Any, faces: Any, name: str) -> tuple[FloatArray, _Made]:
    """xatlas (Young, 2018): one page; degenerate faces are dropped."""
    import xatlas

    work = xatlas.Atlas()
    work.add_mesh(points, faces)
    if name == "xatlas-default":
        work.generate()
    else:
        charts, pages = xatlas.ChartOptions(), xatlas.PackOptions()
        charts.fix_winding = True
        pages.rotate_charts = False
        work.generate(charts, pages)
    _, index, uv = work.get_mesh(0)
    return np.array([work.width, work.height], np.float64), (uv, index, np.zeros(len(uv), np.int64))


def _by_uvunwrap(points: Any, faces: Any, name: str) -> tuple[FloatArray, _Made]:
    """uvunwrap (2025, MIT)."""
    import uvunwrap

    work = uvunwrap.generate(
        [uvunwrap.Mesh(points, faces)], page_size=PAGE_TEXELS, padding=PADDING_TEXELS
    )
    made = work.meshes[0]
    size = np.array([work.width, work.height], np.float64)
    return size, (made.uv, made.indices, np.asarray(made.page, np.int64))
