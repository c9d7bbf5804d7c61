"""Table 1 of the source, measured again: savings of the circle weights over Floater's.

The source (Kim 2019) times its weights against Floater's shape preserving ones (1997) on six meshes, from
60 to 600 vertices, and gives no unit. Times on another machine say nothing side by side; their ratio does.
The ratio found here is reported as it is.
"""

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import Delaunay

from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.errors import OptionError
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions

TIMED_METHOD, TIMED_PEER = "circle", "floater"

# vertices → (its method, Floater), as printed in the source
PRINTED_TIMES = {
    60: (40, 50), 120: (120, 140), 180: (251, 321), 240: (511, 601), 300: (912, 1062), 600: (2323, 2664),
}  # fmt: skip
# smallest and largest ratio in the source; its text says 20 to 30 %
PRINTED_RATIOS = (1.147, 1.279)
RUNS = 31


@dataclass(frozen=True)
class Spread:
    """Seconds of the repeats: the median and the quartiles."""

    median: float
    low: float
    high: float


@dataclass(frozen=True)
class Size:
    """One row: whole seconds of both methods, of their weight stages alone, and the ratio of the medians."""

    vertices: int
    faces: int
    circle: Spread
    floater: Spread
    circle_weights: Spread
    floater_weights: Spread
    ratio: float
    weights_ratio: float
    paper_ratio: float | None

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        return dataclasses.asdict(self)


def timed_sizes(sizes: tuple[int, ...] = tuple(PRINTED_TIMES), repeats: int = RUNS) -> list[Size]:
    """Time circle and floater on a bumped disk of each size, in turns, so that a drift hits both alike.

    sizes: numbers of vertices, from 8 on. repeats: from 1 on, after one that does not count. The time is
    that of weights, boundary, assembly and solve, from the cut mesh to uv. Raises OptionError for other values.
    """
    if min(sizes, default=0) < 8 or repeats < 1:
        raise OptionError("table 1 needs sizes from 8 vertices and at least one repeat")
    return [_row(n, bumped_disk(n), repeats) for n in sizes]


def bumped_disk(n: int) -> CutMesh:
    """A disk of exactly n vertices: random Delaunay triangles in a circle, lifted by smooth bumps."""
    rng = np.random.default_rng(n)
    boundary = min(n - 3, round(2 * np.sqrt(np.pi * n)))
    a = 2 * np.pi * np.arange(boundary) / boundary
    r = np.sqrt(rng.random(n - boundary)) * (1 - 3 / boundary)
    b = 2 * np.pi * rng.random(n - boundary)
    p = np.r_[np.c_[np.cos(a), np.sin(a)], np.c_[r * np.cos(b), r * np.sin(b)]]
    faces = Delaunay(p).simplices.astype(np.int64)
    x, y = p.T
    z = 0.4 * np.exp(-8 * ((x - 0.3) ** 2 + y**2)) - 0.3 * np.exp(-6 * ((x + 0.4) ** 2 + y**2))
    surface, _ = repair(Mesh(np.c_[p, z], faces))
    return surface.cut_mesh(np.zeros(len(surface.edges), bool))


def _row(n: int, cut_mesh: CutMesh, repeats: int) -> Size:
    times: dict[str, list[tuple[float, float]]] = {TIMED_METHOD: [], TIMED_PEER: []}
    for turn in range(repeats + 1):
        for name in (TIMED_METHOD, TIMED_PEER) if turn % 2 else (TIMED_PEER, TIMED_METHOD):
            # a cut mesh that remembers nothing
            arrays = cut_mesh.faces, cut_mesh.rest_triangles, cut_mesh.chart, cut_mesh.edges
            fresh, monitor = CutMesh(*arrays), Monitor()
            start = time.perf_counter()
            METHODS[name].function(fresh, MethodOptions(), monitor)
            seconds = monitor.seconds["weights"], time.perf_counter() - start
            times[name] += [seconds] * (turn > 0)
    circle_w, circle = map(_spread, zip(*times[TIMED_METHOD], strict=True))
    floater_w, floater = map(_spread, zip(*times[TIMED_PEER], strict=True))
    paper = PRINTED_TIMES.get(n)
    return Size(
        n, len(cut_mesh.faces), circle, floater, circle_w, floater_w, floater.median / circle.median,
        floater_w.median / circle_w.median, None if paper is None else paper[1] / paper[0],
    )  # fmt: skip


def _spread(seconds: Sequence[float]) -> Spread:
    low, median, high = np.quantile(seconds, [0.25, 0.5, 0.75])
    return Spread(float(median), float(low), float(high))
