"""Packing beside xatlas on the identical charts, in one run.

    python -m tests.bench.packing [FILE...] [--no-report] [--xatlas-seconds 120]

Every file's own charts are packed at 2048 texels with 4 of padding: by circparam, and by xatlas'
``add_uv_mesh`` with bruteForce on. Both are measured alike: share of the unit square covered, on a raster of
2048. xatlas leaves out faces of uv area below 1.2e-7 and then lays charts over each other; the uv are scaled
up before, so that it packs all of them. xatlas runs in a process of its own, ended after a bound.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from circparam.core.arrays import relabel
from circparam.geometry.raster import free_border, owner_raster, smallest_gap
from circparam.mesh.mesh import UVMap
from circparam.packing import pack
from circparam.packing.options import PackOptions
from tests.bench.common import table, write
from tests.support.corpus import CORPUS

RESOLUTION, PADDING = 2048, 4
WITH_UV = (
    "spot.obj",
    "beast.obj",
    "fuze.obj",
    "maze.obj",
    "bunny10k_textured.ply",
    "SheenCloth.glb",
)


def charts_of(path: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Faces, uv and charts of a file."""
    from circparam import formats

    uvmap = formats.read(path).uv()
    if uvmap is None:
        raise SystemExit(f"{path}: no uv, so no charts to pack")
    faces = uvmap.uv_faces[(uvmap.uv_faces >= 0).all(1)]
    return faces, uvmap.uv, relabel(UVMap(uvmap.uv, faces).charts)[1]


def _xatlas(faces: np.ndarray, uv: np.ndarray, queue: multiprocessing.Queue) -> None:
    import xatlas

    atlas = xatlas.Atlas()
    large = (uv - uv.min(0)) * (RESOLUTION / np.ptp(uv, axis=0).max())
    atlas.add_uv_mesh(large.astype(np.float32), faces.astype(np.uint32))
    options = xatlas.PackOptions()
    options.resolution, options.padding, options.bruteForce = RESOLUTION, PADDING, True
    start = time.perf_counter()
    atlas.generate(pack_options=options)
    seconds = time.perf_counter() - start
    _, index, out = atlas.get_mesh(0)
    # its pages are not square: measured as the share of the square they need
    square = np.asarray(out) * [atlas.width, atlas.height] / max(atlas.width, atlas.height)
    queue.put((np.asarray(index, np.int64), square, atlas.chart_count, seconds))


def xatlas_share(
    faces: np.ndarray, uv: np.ndarray, bound: float
) -> tuple[float, int, float] | None:
    """Covered share, charts and seconds of xatlas; None where it did not end in time."""
    queue: multiprocessing.Queue = multiprocessing.get_context("spawn").Queue()
    child = multiprocessing.get_context("spawn").Process(target=_xatlas, args=(faces, uv, queue))
    child.start()
    try:
        index, out, charts, seconds = queue.get(timeout=bound)
    except Exception:
        child.terminate()
        return None
    child.join()
    grid, _ = owner_raster(out[index] * RESOLUTION, np.zeros(len(index), np.int64), RESOLUTION)
    return float((grid >= 0).mean()), charts, seconds


def measure(path: str, bound: float) -> dict[str, object]:
    """One row of the table."""
    faces, uv, chart = charts_of(path)
    start = time.perf_counter()
    packed = pack(faces, uv, chart, PackOptions(RESOLUTION, PADDING))
    seconds = time.perf_counter() - start
    grid, _ = owner_raster(packed.uv[faces] * RESOLUTION, chart, RESOLUTION)
    gap, border = smallest_gap(grid, PADDING + 1)[0], free_border(grid)
    theirs = xatlas_share(faces, uv, bound)
    return {
        "file": Path(path).name,
        "charts": int(chart.max()) + 1,
        "ours": float((grid >= 0).mean()),
        "seconds": seconds,
        "kept": gap >= PADDING + 1 and border >= PADDING,
        "xatlas": theirs,
    }


def report(rows: list[dict[str, object]]) -> list[str]:
    """The rows as a Markdown table, with the means."""
    cells, ratios = [], []
    for r in rows:
        text = [str(r["file"]), str(r["charts"]), f"{r['ours']:.3f}", f"{r['seconds']:.1f}"]
        text.append("yes" if r["kept"] else "**no**")
        theirs = r["xatlas"]
        if isinstance(theirs, tuple):
            ratios.append(float(str(r["ours"])) / theirs[0])
            more = "" if theirs[1] == r["charts"] else f" ({theirs[1]} charts)"
            text += [f"{theirs[0]:.3f}{more}", f"{theirs[2]:.1f}", f"{ratios[-1]:.2f}"]
        else:
            text += ["not in time", "", ""]
        cells.append(text)
    mean = f"Mean share {np.mean([float(str(r['ours'])) for r in rows]):.3f}."
    if ratios:
        mean += f" Ratio to xatlas: mean {np.mean(ratios):.2f}, least {min(ratios):.2f}."
    head = ["file", "charts", "circparam share", "s", "padding kept", "xatlas share", "s", "ratio"]
    return [*table(head, cells), "", mean]


def main(arguments: list[str] | None = None) -> int:
    """Measure the files, print the table and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="files with uv; those of the corpus if left out")
    parser.add_argument("--no-report", action="store_true", help="print only")
    parser.add_argument("--xatlas-seconds", type=float, default=120.0)
    chosen = parser.parse_args(arguments)
    rows = []
    for path in chosen.files or [
        str(CORPUS / name) for name in WITH_UV if (CORPUS / name).exists()
    ]:
        rows.append(measure(path, chosen.xatlas_seconds))
        print(rows[-1], flush=True)
    if not rows:
        print("no files with uv: name some")
        return 0
    lines = report(rows)
    print("\n".join(lines))
    if not chosen.no_report:
        intro = (
            f"The identical charts of each file at {RESOLUTION} texels, padding {PADDING}: covered texels as "
            "a share of the unit square. xatlas: `add_uv_mesh`, bruteForce on. "
            "Written by `make bench-packing`."
        )
        write("packing.md", "Packing beside xatlas", intro, [lines])
    return 0 if all(r["kept"] for r in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
