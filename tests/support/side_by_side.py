"""A mesh with layouts of every kind, to be shown side by side."""

import numpy as np

from circparam.mesh.mesh import Mesh, UVMap
from circparam.render.side_by_side import MethodLayout, SideBySide


def compared_sheet() -> SideBySide:
    """A bent sheet: itself, the same squeezed, and a method without a result."""
    n = 8
    g = np.linspace(0, 1, n + 1)
    x, y = np.meshgrid(g, g)
    flat = np.stack([x.ravel(), y.ravel()], 1)
    i = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].ravel()
    faces = np.concatenate(
        [np.stack([i, i + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + n + 1], 1)]
    )
    points = np.concatenate([flat, np.zeros((len(flat), 1))], 1)
    rows = [
        MethodLayout("good", UVMap(flat, faces), "ok",
             {"seconds": 2.0, "distortion": 1.0, "flips": 0, "peak_bytes": 3_000_000},
             {"weights": 0.5, "solve": 1.0}),
        MethodLayout("bad <b>", UVMap(flat * [1.0, 0.2], faces), "invalid",
             {"seconds": 0.5, "distortion": 2.6, "flips": 3}, {"solve": 0.5}),
        MethodLayout("none", None, "failed", {}, {}, "out of luck & time"),
    ]  # fmt: skip
    return SideBySide("sheet", Mesh(points, faces), rows, "128 faces")
