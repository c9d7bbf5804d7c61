"""The compiled functions of SciPy that this project calls, without the packages round them.

Those packages import each other: ``scipy.sparse.linalg`` takes 40 ms for one function, ``scipy.spatial``
50 ms. In processes of our own (``core.imports.put_off``) the modules named here load alone. Those modules are
private to SciPy; where a version has them elsewhere, the packages are imported.
"""

from functools import cache
from typing import TYPE_CHECKING, Any

from circparam.core.imports import alone

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
else:
    import scipy.sparse  # noqa: F401, which holds the others

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
    "connected_components",
    "dijkstra",
    "gstrf",
    "kd_tree",
    "maximum_flow",
    "minimum_spanning_tree",
]
