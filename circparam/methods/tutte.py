"""The convex methods: one algorithm, a weight scheme each."""

from __future__ import annotations

from circparam.core.monitor import Monitor
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.base import Layout, MethodOptions, direct
from circparam.solvers.tutte.graded import embed


def convex(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor, *, weights: str) -> Layout:
    """The convex map of one weight scheme on the boundary of the options."""
    uv, notes = embed(cut_mesh, weights, options.tutte, monitor)
    return direct(cut_mesh, uv, notes)
