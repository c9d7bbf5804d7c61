"""Pack charts with another packer: ``python pack_peers.py PEER IN.npz OUT.npz``, under a Python that has it.

IN holds faces (m, 3), uv (nv, 2), chart (m,), and resolution, padding and seconds; OUT gets faces, and uv
(nv, 2) on one square page that is one unit wide. What the peer says of itself is printed as JSON. Needs NumPy
and the peer only (sparrow: spyrrow and shapely), so that it runs in environments that have no circparam.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np

# pages of xatlas' search: brute force tries every texel, and of 2048 squared it takes minutes to hours
COARSER = 4
APART = 4.01  # texels that two outlines keep at padding 4: what an upright strip between them needs at least
TRIES = 2  # short runs by which the height is found at which sparrow's strip is square
PART = 0.2  # of its seconds that each of them gets
SLOWEST = (
    0.25  # share of a processor that it is taken to have, at least, where others run beside it
)
SIMPLER = 0.25  # texels by which corners of outlines may be off that sparrow is given


def xatlas(given: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """xatlas' packer with brute force, on a page a quarter as fine with a quarter of the padding."""
    import xatlas as package

    faces, uv = given["faces"], given["uv"]
    resolution = int(given["resolution"]) // COARSER
    atlas = package.Atlas()
    # it leaves out faces of uv area below 1.2e-7 and lays charts over each other then: scaled up
    large = (uv - uv.min(0)) * (int(given["resolution"]) / np.ptp(uv, axis=0).max())
    atlas.add_uv_mesh(large.astype(np.float32), faces.astype(np.uint32))
    options = package.PackOptions()
    options.resolution, options.bruteForce = resolution, True
    options.padding = int(given["padding"]) // COARSER
    start = time.perf_counter()
    atlas.generate(pack_options=options)
    seconds = time.perf_counter() - start
    _, index, out = atlas.get_mesh(0)
    # its pages are not square: measured as the share of the square they need
    square = np.asarray(out) * [atlas.width, atlas.height] / max(atlas.width, atlas.height)
    said = {"seconds": seconds, "charts": atlas.chart_count, "pages": atlas.atlas_count}
    return np.asarray(index, np.int64), square, said


def _outlines(given: dict[str, Any]) -> list[np.ndarray]:
    """The outer outline (k, 2) of every chart, in uv."""
    import shapely

    corners = given["uv"][given["faces"]]
    out = []
    for c in range(int(given["chart"].max()) + 1):
        whole = shapely.union_all(shapely.polygons(corners[given["chart"] == c]))
        if whole.geom_type != "Polygon":  # parts that meet in a point or not at all
            whole = max(shapely.get_parts(whole), key=lambda part: part.area)
        out.append(np.asarray(whole.exterior.coords))
    return out


def sparrow(given: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """sparrow's strip packing at the height at which the strip comes out square; holes stay empty."""
    import shapely
    import spyrrow

    resolution, padding = int(given["resolution"]), int(given["padding"])
    inner = resolution - 2 * (padding - 0.5)
    outlines = _outlines(given)
    area = sum(shapely.Polygon(o).area for o in outlines)
    height = float(np.sqrt(area / 0.65))
    parts = [PART * float(given["seconds"])] * TRIES + [float(given["seconds"])]
    best: tuple[float, Any] | None = None
    begun, worked = time.perf_counter(), time.process_time()
    share = 1.0  # of a processor: sparrow counts seconds of the clock
    for seconds in parts:
        texel = height / inner
        shapes = [shapely.LineString(o).simplify(SIMPLER * texel).coords for o in outlines]
        items = [spyrrow.Item(str(c), list(s), 1, None) for c, s in enumerate(shapes)]
        config = spyrrow.StripPackingConfig(
            total_computation_time=int(np.ceil(seconds / share)),
            min_items_separation=APART * texel,
            num_workers=1,
            seed=1,
        )
        solution = spyrrow.StripPackingInstance("charts", height, items).solve(config)
        side = max(height, solution.width)
        if best is None or side < best[0]:
            best = side, solution
        height = float(np.sqrt(height * solution.width))
        took = time.perf_counter() - begun
        share = min(max((time.process_time() - worked) / took, SLOWEST), 1.0)
    if best is None:
        raise SystemExit("sparrow found no layout")
    uv = np.zeros_like(given["uv"])
    for placed in best[1].placed_items:
        own = np.unique(given["faces"][given["chart"] == int(placed.id)])
        t = np.deg2rad(placed.rotation)
        turn = np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])
        uv[own] = given["uv"][own] @ turn + placed.translation
    border = (padding - 0.5) / resolution
    page = uv * (inner / best[0] / resolution) + border
    said = {"seconds": time.process_time() - worked, "charts": len(outlines), "pages": 1}
    return given["faces"], page, said


PEERS = {"xatlas": xatlas, "sparrow": sparrow}


def main() -> None:
    """Run one peer."""
    name, source, target = sys.argv[1:4]
    with np.load(source) as stored:
        given = dict(stored)
    faces, uv, said = PEERS[name](given)
    np.savez(target, faces=faces, uv=uv)
    print(json.dumps(said))


if __name__ == "__main__":
    main()
