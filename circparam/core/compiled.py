"""The compiled functions of SciPy that this project calls, without the packages round them.

Those packages import each other: ``scipy.sparse.linalg`` takes 40 ms for one function, ``scipy.spatial``
50 ms. In processes of our own (``core.imports.put_off``) the modules named here load alone. Those modules are
private to SciPy; where a version has them elsewhere, the packages are imported.
"""

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from circparam.core.imports import alone
from circparam.core.types import IntArray

if TYPE_CHECKING:
    from scipy.sparse.csgraph import (
        breadth_first_order,
        connected_components,
        dijkstra,
        maximum_flow,
        minimum_spanning_tree,
    )
    from scipy.sparse.linalg import SuperLU
    from scipy.spatial import cKDTree

    gstrf: Any
    coo_tocsr: Any
    label_components: Any
else:
    import scipy.sparse  # noqa: F401, which holds the others

    try:
        from scipy.sparse._sparsetools import coo_tocsr
    except ImportError:
        coo_tocsr = None  # ``compressed_rows`` sorts

    try:
        with alone("scipy.sparse.csgraph", "scipy.sparse.linalg", "scipy.sparse.linalg._dsolve"):
            from scipy.sparse.csgraph._flow import maximum_flow
            from scipy.sparse.csgraph._min_spanning_tree import minimum_spanning_tree
            from scipy.sparse.csgraph._shortest_path import dijkstra
            from scipy.sparse.csgraph._traversal import breadth_first_order, connected_components
            from scipy.sparse.linalg._dsolve._superlu import SuperLU, gstrf
    except ImportError:
        from scipy.sparse.csgraph import (
            breadth_first_order,
            connected_components,
            dijkstra,
            maximum_flow,
            minimum_spanning_tree,
        )
        from scipy.sparse.linalg import SuperLU

        gstrf = None  # ``splu`` calls it
    try:
        from scipy.sparse.csgraph._traversal import (
            _connected_components_undirected as label_components,
        )

        none, one = np.zeros(0, np.int32), np.zeros(1, np.int32)
        label_components(none, np.zeros(2, np.int32), none, np.zeros(2, np.int32), one - 1)
    except (ImportError, TypeError, ValueError):  # another signature
        label_components = None  # ``connected_components`` calls it


def compressed_rows(n: int, rows: Any, columns: Any) -> tuple[Any, Any]:
    """A counting sort of entries by their rows: (start (n + 1,), columns (e,) row after row), both int32.

    rows: (e,) integers from 0 to n − 1. columns: (e,) below 2³¹. Those of one row stay in their order.
    """
    count = len(rows)
    if coo_tocsr is None:
        start = np.searchsorted(np.sort(rows), np.arange(n + 1)).astype(np.int32)
        return start, columns[np.argsort(rows, kind="stable")].astype(np.int32)
    start, sorted_columns = np.empty(n + 1, np.int32), np.empty(count, np.int32)
    values = np.empty(count, np.int8)  # SciPy sorts them along
    coo_tocsr(
        n,
        n,
        count,
        rows.astype(np.int32, copy=False),
        columns.astype(np.int32, copy=False),
        values,
        start,
        sorted_columns,
        np.empty_like(values),
    )
    return start, sorted_columns


def component_labels(n: int, i: IntArray, j: IntArray) -> tuple[int, IntArray]:
    """Connected components of n nodes joined by i–j: (number, (n,) label in order of the lowest node).

    SciPy's function takes five times as long for its checks and for its copies of the graph.
    """
    start, ahead = compressed_rows(n, i, j)
    if label_components is None:
        from scipy.sparse import csr_matrix

        graph = csr_matrix((np.ones(len(ahead), bool), ahead, start), shape=(n, n))
        count, labels = connected_components(graph, directed=False)
        return int(count), labels.astype(np.int64)
    start_back, back = compressed_rows(n, j, i)
    labels = np.full(n, -1, np.int32)  # −1: not reached yet
    count = label_components(ahead, start, back, start_back, labels)
    return int(count), labels.astype(np.int64)


def kd_tree(points: Any, **options: Any) -> "cKDTree":
    """A k-d tree of points (n, d); options: as for ``scipy.spatial.cKDTree``."""
    return _kd_tree_class()(points, **options)


@cache
def _kd_tree_class() -> "type[cKDTree]":
    try:
        with alone("scipy.spatial"):
            from scipy.spatial._ckdtree import cKDTree
    except ImportError:
        from scipy.spatial import cKDTree
    return cKDTree


__all__ = [
    "SuperLU",
    "breadth_first_order",
    "component_labels",
    "compressed_rows",
    "connected_components",
    "dijkstra",
    "gstrf",
    "kd_tree",
    "maximum_flow",
    "minimum_spanning_tree",
]
