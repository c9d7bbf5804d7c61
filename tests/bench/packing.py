"""Full pages: atlases with and without cuts for them; identical charts packed beside xatlas and sparrow.

    python -m tests.bench packing [FILE...] [--no-report] [--sparrow PYTHON]

Every mesh is unwrapped at the defaults and with ``--pack-splits 0``: charts, length of the seams, covered share
at 2048 texels and padding 4, and what packing takes of all seconds. Files that are named replace the corpus.

Then identical charts, those of ``--pack-splits 0`` and those of files with uv, are packed at 2048 texels with 4
of padding: by circparam; by xatlas with brute force, which tries every texel of the page and so gets one of 512
with a padding of 1 (the same in shares of the page; at 2048 it does not end in minutes); and by sparrow, whose
strip is as high as it comes out wide. All are measured alike: share of the unit square covered, on a raster of
2048. Peers run in processes of their own (``peers.py``).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from circparam import formats, unwrap
from circparam.core.arrays import relabel
from circparam.geometry.raster import free_border, smallest_gap
from circparam.mesh.mesh import UVMap
from circparam.packing import pack
from circparam.packing.options import PackOptions
from tests.bench.atlases import run_peer
from tests.bench.common import Line, figures, options, table, write
from tests.support.corpus import CORPUS, SUFFIXES
from tests.support.packing import owner_raster

RESOLUTION, PADDING = 2048, 4
LARGE = 25_000_000  # bytes
FEW = 20  # charts up to which as much is asked as sparrow reaches
SPARROW_UP_TO = 300
XATLAS_SECONDS, SPARROW_SECONDS = 30.0, 20.0  # of the search; each is ended after ten times as long
WITH_UV = (
    "spot.obj", "beast.obj", "fuze.obj", "maze.obj", "bunny10k_textured.ply", "SheenCloth.glb",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Charts:
    """Charts to pack: faces (m, 3) into uv (nv, 2), chart (m,)."""

    name: str
    faces: np.ndarray
    uv: np.ndarray
    chart: np.ndarray

    @classmethod
    def of(cls, name: str, uvmap: UVMap) -> Charts:
        """Those of a layout."""
        faces = uvmap.uv_faces[(uvmap.uv_faces >= 0).all(1)]
        return cls(name, faces, uvmap.uv, relabel(UVMap(uvmap.uv, faces).charts)[1])

    @property
    def arrays(self) -> dict[str, Any]:
        """What a peer is given."""
        size = {"resolution": RESOLUTION, "padding": PADDING}
        return {"faces": self.faces, "uv": self.uv, "chart": self.chart, **size}

    def packed(self) -> np.ndarray:
        """(m, 3, 2) corners on a page by circparam."""
        options = PackOptions(RESOLUTION, PADDING)
        return pack(self.faces, self.uv, self.chart, options).uv[self.faces]


def peer(name: str, python: str, charts: Charts, seconds: float) -> dict[str, Any] | None:
    """Covered share by another packer and what it says; None where it did not end in time or failed."""
    given = charts.arrays | {"seconds": seconds}
    with tempfile.TemporaryDirectory() as folder:
        try:
            out, said = run_peer(name, python, given, Path(folder), 10 * seconds)
        except (subprocess.TimeoutExpired, RuntimeError):
            return None
    corners = out["uv"][out["faces"]] * RESOLUTION
    grid = owner_raster(corners, np.zeros(len(corners), np.int64), RESOLUTION)
    return {**said, "share": float((grid >= 0).mean())}


def measure(charts: Charts, sparrow: str | None) -> dict[str, Any]:
    """One row of the table of identical charts."""
    start = time.perf_counter()
    corners = charts.packed() * RESOLUTION
    seconds = time.perf_counter() - start
    grid = owner_raster(corners, charts.chart, RESOLUTION)
    gap, border = smallest_gap(grid, PADDING + 1)[0], free_border(grid)
    count = int(charts.chart.max()) + 1
    nested = sparrow if 1 < count <= SPARROW_UP_TO else None
    return {
        "file": charts.name,
        "charts": count,
        "ours": float((grid >= 0).mean()),
        "seconds": seconds,
        "kept": gap >= PADDING + 1 and border >= PADDING,
        "pack-xatlas": peer("pack-xatlas", sys.executable, charts, XATLAS_SECONDS),
        "sparrow": peer("sparrow", nested, charts, SPARROW_SECONDS) if nested else None,
    }


def atlas(path: Path) -> tuple[dict[str, Any], Charts]:
    """One mesh unwrapped with charts left whole, and at the defaults; and the whole charts."""
    whole = unwrap(path, pack_splits=0)
    charts = Charts.of(path.name, UVMap(whole.uv, whole.uv_faces))
    full = unwrap(path)
    keys = ("charts", "seam_length", "pack")
    row = {k: (whole.measures[k], full.measures[k]) for k in keys}
    seconds = {"packing": full.seconds.get("pack", 0.0), "seconds": sum(full.seconds.values())}
    return {"file": path.name, **row, **seconds}, charts


def atlas_report(rows: list[dict[str, Any]]) -> list[str]:
    """The atlases as a Markdown table, with what is asked of all of them together."""
    cells, shares, ratios = [], [], []
    for r in rows:
        (c0, c1), (l0, l1), (s0, s1) = r["charts"], r["seam_length"], r["pack"]
        packing = f"{r['packing']:.2f} ({100 * r['packing'] / r['seconds']:.0f} %)"
        ratio = f"{l1 / l0:.3f}" if l0 else "-"
        pages = f"{s0:.3f} → {s1:.3f}"
        cells.append([r["file"], f"{c0} → {c1}", f"{l0:.2f}", ratio, pages, packing])
        if c0 > 1 or l0:
            shares.append((s0, s1))
        if l0:
            ratios.append(l1 / l0)
    lines = []
    if shares:
        before, after = np.mean(shares, 0)
        detail = f"{before:.3f} whole"
        lines += [Line("covered share, mean", after, "", ">= 0.68", detail)]
        lines += [Line("covered share, least", np.min(shares, 0)[1], "", ">= 0.55")]
    if ratios:
        name = "seams over those of whole charts"
        lines += [Line(f"{name}, median", float(np.median(ratios)), "", "<= 1.06")]
        lines += [Line(f"{name}, most", max(ratios), "", "<= 1.15")]
    head = ["file", "charts", "seams", "ratio", "covered share", "seconds of packing"]
    note = "Meshes that need no seam are not in the means."
    return [*table(head, cells), "", *figures(lines), "", note]


def report(rows: list[dict[str, Any]]) -> list[str]:
    """Identical charts as a Markdown table, with what is asked of all of them together."""
    cells: list[list[str]] = []
    ratios: dict[str, list[tuple[int, float]]] = {"pack-xatlas": [], "sparrow": []}
    for r in sorted(rows, key=lambda r: r["charts"]):
        text = [r["file"], str(r["charts"]), f"{r['ours']:.3f}", f"{r['seconds']:.1f}"]
        text.append("yes" if r["kept"] else "**no**")
        for name, found in ratios.items():
            peer = r[name]
            if peer is None:
                text += ["-", "", ""]
                continue
            found.append((r["charts"], r["ours"] / peer["share"]))
            more = "" if peer["charts"] == r["charts"] else f" ({peer['charts']} charts)"
            text += [f"{peer['share']:.3f}{more}", f"{peer['seconds']:.1f}", f"{found[-1][1]:.2f}"]
        cells.append(text)
    lines = [Line("covered share, mean", float(np.mean([r["ours"] for r in rows])))]
    beside = [ratio for _, ratio in ratios["pack-xatlas"]]
    if beside:
        lines += [Line("ratio to xatlas, mean", float(np.mean(beside)), "", ">= 1.30")]
        lines += [Line("ratio to xatlas, least", min(beside), "", ">= 1.05")]
    for few, goal in ((True, 1.0), (False, 0.95)):
        nested = [ratio for n, ratio in ratios["sparrow"] if (n <= FEW) is few]
        if nested:
            name = f"ratio to sparrow, {'up to' if few else 'more than'} {FEW} charts, least"
            below = f"{sum(x < goal for x in nested)} of {len(nested)} below"
            detail = f"mean {np.mean(nested):.3f}; {below}"
            lines.append(Line(name, min(nested), "", f">= {goal}", detail))
    head = ["file", "charts", "circparam share", "s", "padding kept"]
    head += ["xatlas share", "s", "ratio", "sparrow share", "s", "ratio"]
    return [*table(head, cells), "", *figures(lines)]


def sources(chosen: argparse.Namespace) -> list[Path]:
    """The meshes that are named, else those of the corpus that are unwrapped in a minute or so."""
    every = [p for p in CORPUS.glob("*") if p.suffix.lower() in SUFFIXES]
    return chosen.files or sorted(p for p in every if p.stat().st_size < LARGE)


def main() -> int:
    """Measure the files, print the tables and write the page."""
    parser = options(__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="meshes; the corpus if left out")
    parser.add_argument("--sparrow", help="a Python that has spyrrow and shapely")
    chosen = parser.parse_args()
    atlases, charts = [], []
    for path in sources(chosen):
        row, whole = atlas(path)
        atlases.append(row)
        charts.append(whole)
        print(row, flush=True)
    for path in [] if chosen.files else [CORPUS / n for n in WITH_UV if (CORPUS / n).exists()]:
        charts.append(Charts.of(f"{path.name} (its own)", formats.read(path).uv()))
    rows = []
    for some in charts:
        rows.append(measure(some, chosen.sparrow))
        print(rows[-1], flush=True)
    if not rows:
        parser.error("no meshes: name some, or set CIRCPARAM_CORPUS to a folder that has them")
    parts = [atlas_report(atlases), report(rows)]
    print("\n".join(line for part in parts for line in part))
    if not chosen.no_report:
        intro = (
            f"Pages of {RESOLUTION} texels, padding {PADDING}: covered texels as a share of the unit "
            "square. First whole atlases, with `--pack-splits 0` and at the defaults; then identical "
            "charts, those of `--pack-splits 0` and those of files with uv, beside xatlas (`add_uv_mesh`, "
            "bruteForce on a page of 512 with a padding of 1, since at 2048 it does not end in minutes) and "
            f"sparrow ({SPARROW_SECONDS:g} s of a processor for the strip, and twice a fifth of that "
            "before to find the height at which it is square; outlines without holes, 2 to "
            f"{SPARROW_UP_TO} charts). Written by `make bench-packing`."
        )
        write("packing.md", "Full pages", intro, parts)
    return 0 if all(r["kept"] for r in rows) else 1
