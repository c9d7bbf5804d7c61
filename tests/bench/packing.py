"""Full pages: atlases with and without cuts for them; and packing beside xatlas on the identical charts.

    python -m tests.bench.packing [FILE...] [--no-report] [--xatlas-seconds 120] [--atlases-only]

Every mesh is unwrapped at the defaults and with ``--pack-splits 0``: charts, length of the seams, covered share
at 2048 texels and padding 4, and what packing takes of all seconds. Files that are named replace the corpus.

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
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from circparam.core.arrays import relabel
from circparam.geometry.raster import free_border, owner_raster, smallest_gap
from circparam.mesh.mesh import UVMap
from circparam.packing import pack
from circparam.packing.options import PackOptions
from tests.bench.common import Line, figures, table, write
from tests.support.corpus import CORPUS

RESOLUTION, PADDING = 2048, 4
LARGE = 25_000_000  # bytes
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


def _is_mesh(path: Path) -> bool:
    """Whether a file of the corpus is a mesh that is unwrapped in a minute or so."""
    known = (".obj", ".off", ".ply", ".stl", ".glb")
    return path.suffix.lower() in known and path.stat().st_size < LARGE


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


def atlas(path: str) -> dict[str, object]:
    """One mesh unwrapped with charts left whole, and at the defaults."""
    from circparam import unwrap

    whole, full = (unwrap(path, pack_splits=splits) for splits in (0, None))
    before, after = whole.measures, full.measures
    seconds = full.seconds
    return {
        "file": Path(path).name,
        "charts": (before["charts"], after["charts"]),
        "seams": (before["seam_length"], after["seam_length"]),
        "share": (before["pack"], after["pack"]),
        "flat": bool(before["charts"] == 1 and before["seam_length"] == 0),
        "packing": seconds.get("pack", 0.0),
        "seconds": sum(seconds.values()),
    }


def atlas_report(rows: list[dict[str, Any]]) -> list[str]:
    """The atlases as a Markdown table, with what is asked of all of them together."""
    cells = []
    for r in rows:
        (c0, c1), (l0, l1), (s0, s1) = r["charts"], r["seams"], r["share"]
        ratio = f"{l1 / l0:.3f}" if l0 else "-"
        packing = f"{r['packing']:.2f} ({100 * r['packing'] / r['seconds']:.0f} %)"
        cells.append(
            [r["file"], f"{c0} → {c1}", f"{l0:.2f}", ratio, f"{s0:.3f} → {s1:.3f}", packing]
        )
    cut = [r for r in rows if not r["flat"]]
    ratios = [r["seams"][1] / r["seams"][0] for r in cut if r["seams"][0]]
    shares = np.array([r["share"] for r in cut])
    lines = [
        Line(
            "covered share, mean",
            shares[:, 1].mean(),
            "",
            ">= 0.68",
            f"{shares[:, 0].mean():.3f} whole",
        ),
        Line("covered share, least", shares[:, 1].min(), "", ">= 0.55"),
        Line("seams over those of whole charts, median", float(np.median(ratios)), "", "<= 1.06"),
        Line("seams over those of whole charts, most", max(ratios), "", "<= 1.15"),
    ]
    head = ["file", "charts", "seams", "ratio", "covered share", "seconds of packing"]
    return [
        *table(head, cells),
        "",
        *figures(lines),
        "",
        "Meshes that need no seam are not in the means.",
    ]


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
    parser.add_argument("files", nargs="*", help="meshes; those of the corpus if left out")
    parser.add_argument("--atlases-only", action="store_true", help="nothing beside xatlas")
    parser.add_argument("--no-report", action="store_true", help="print only")
    parser.add_argument("--xatlas-seconds", type=float, default=120.0)
    chosen = parser.parse_args(arguments)
    meshes = chosen.files or [str(p) for p in sorted(CORPUS.glob("*")) if _is_mesh(p)]
    atlases = []
    for path in meshes:
        atlases.append(atlas(path))
        print(atlases[-1], flush=True)
    if not atlases:
        print("no meshes: name some")
        return 0
    whole = atlas_report(atlases)
    print("\n".join(whole))
    rows = []
    with_uv = chosen.files or [str(CORPUS / name) for name in WITH_UV if (CORPUS / name).exists()]
    for path in [] if chosen.atlases_only else with_uv:
        rows.append(measure(path, chosen.xatlas_seconds))
        print(rows[-1], flush=True)
    lines = report(rows) if rows else []
    print("\n".join(lines))
    if not chosen.no_report:
        intro = (
            f"Pages of {RESOLUTION} texels, padding {PADDING}: covered texels as a share of the unit "
            "square. First whole atlases, with `--pack-splits 0` and at the defaults; then the identical "
            "charts of files with uv beside xatlas (`add_uv_mesh`, bruteForce on). Written by "
            "`make bench-packing`."
        )
        write("packing.md", "Full pages", intro, [whole, lines])
    return 0 if all(r["kept"] for r in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
