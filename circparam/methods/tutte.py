"""The convex methods: one algorithm, a weight scheme each."""

from __future__ import annotations

from circparam.core.monitor import Monitor
from circparam.mesh.cut_mesh import Patches
from circparam.methods.base import Layout, MethodOptions, direct
from circparam.solvers.tutte.graded import embed


def convex(patches: Patches, options: MethodOptions, monitor: Monitor, *, weights: str) -> Layout:
    """The convex map of one weight scheme on the border of the options."""
    uv, notes = embed(patches, weights, options.tutte, monitor)
    return direct(patches, uv, notes)
