"""The convex methods: one algorithm, a weight scheme each."""

from functools import partial

from circparam.core.monitor import Monitor
from circparam.core.registry import Row
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.base import Layout, MethodOptions, MethodRow, direct
from circparam.solvers.tutte.graded import embed
from circparam.solvers.tutte.weights import WEIGHTS, WeightFunction


def convex(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor, *, weights: str) -> Layout:
    """The convex map of one weight scheme on the boundary of the options."""
    uv, notes = embed(cut_mesh, weights, options.tutte, monitor)
    return direct(cut_mesh, uv, notes)


def _row(scheme: Row[WeightFunction]) -> MethodRow:
    """The method of a weight scheme; positive weights on a convex boundary never flip a face."""
    tags = (scheme.tags - {"reproduces-plane"}) | {"convex-boundary"}
    return Row(
        scheme.name,
        partial(convex, weights=scheme.name),
        scheme.summary,
        scheme.citation,
        tags | {"flip-free"} if "positive" in tags else tags,
        scheme.condition,
        frozenset({"boundary", "polygon", "spacing", "clamp"}),
    )


ROWS: tuple[MethodRow, ...] = tuple(_row(scheme) for scheme in WEIGHTS)
