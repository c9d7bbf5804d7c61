"""The compiled functions of SciPy that this project calls, without the packages round them.

Those packages import each other: ``scipy.sparse.linalg`` takes 40 ms for one function, ``scipy.spatial``
50 ms. In processes of our own (``core.imports.put_off``) the modules named here load alone. Those modules are
private to SciPy; where a version has them elsewhere, the packages are imported.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse  # noqa: F401, before the modules in it

from circparam.core.imports import private

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_GRAPHS, _TREES = "scipy.sparse.csgraph", "scipy.spatial"
maximum_flow = private(f"{_GRAPHS}._flow", "maximum_flow", _GRAPHS)
minimum_spanning_tree = private(f"{_GRAPHS}._min_spanning_tree", "minimum_spanning_tree", _GRAPHS)
dijkstra = private(f"{_GRAPHS}._shortest_path", "dijkstra", _GRAPHS)
breadth_first_order = private(f"{_GRAPHS}._traversal", "breadth_first_order", _GRAPHS)
# None: others call these three
gstrf = private("scipy.sparse.linalg._dsolve._superlu", "gstrf")
coo_tocsr = private("scipy.sparse._sparsetools", "coo_tocsr")
label_components = private(f"{_GRAPHS}._traversal", "_connected_components_undirected")
try:
    _none, _one = np.zeros(0, np.int32), np.zeros(1, np.int32)
    label_components(_none, np.zeros(2, np.int32), _none, np.zeros(2, np.int32), _one - 1)
except (TypeError, ValueError):  # another signature
    label_components = None


def compressed_rows(n: int, rows: Any, columns: Any) -> tuple[Any, Any]:
    """A counting sort of entries by their rows: (start (n + 1,), columns (e,) row after row), both int32.

    rows: (e,) integers from 0 to n − 1. columns: (e,) below 2³¹. Those of one row stay in their order.
    """
    count = len(rows)
    if coo_tocsr is None:
        start = np.searchsorted(np.sort(rows), np.arange(n + 1)).astype(np.int32)
        return start, columns[np.argsort(rows, kind="stable")].astype(np.int32)
    start, sorted_columns = np.empty(n + 1, np.int32), np.empty(count, np.int32)
    values = np.empty((2, count), np.int8)  # SciPy sorts them along
    entries = rows.astype(np.int32, copy=False), columns.astype(np.int32, copy=False), values[0]
    coo_tocsr(n, n, count, *entries, start, sorted_columns, values[1])
    return start, sorted_columns


def kd_tree(points: Any, **options: Any) -> "cKDTree":
    """A k-d tree of points (n, d); options: as for ``scipy.spatial.cKDTree``."""
    return private(f"{_TREES}._ckdtree", "cKDTree", _TREES)(points, **options)
