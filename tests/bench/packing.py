"""Full pages: atlases with and without cuts for them; identical charts packed beside xatlas and sparrow.

    python -m tests.bench.packing [FILE...] [--no-report] [--atlases-only | --charts-only]
        [--xatlas-seconds 300] [--sparrow PYTHON] [--sparrow-seconds 20] [--known FILE]

Every mesh is unwrapped at the defaults and with ``--pack-splits 0``: charts, length of the seams, covered share
at 2048 texels and padding 4, and what packing takes of all seconds. Files that are named replace the corpus.

Then identical charts, those of ``--pack-splits 0`` and those of files with uv, are packed at 2048 texels with 4
of padding: by circparam; by xatlas with brute force, which tries every texel of the page and so gets one of 512
with a padding of 1 (the same in shares of the page; at 2048 it does not end in minutes); and by sparrow, whose
strip is as high as it comes out wide. All are measured alike: share of the unit square covered, on a raster of
2048. Peers run in processes of their own (``pack_peers.py``). ``--known`` keeps their figures, by charts.
"""

from __future__ import annotations

import argparse
import hashlib
import json
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

from circparam.core.arrays import relabel
from circparam.geometry.raster import free_border, smallest_gap
from circparam.mesh.mesh import UVMap
from circparam.packing import pack
from circparam.packing.options import PackOptions
from tests.bench.common import Line, figures, table, write
from tests.support.corpus import CORPUS
from tests.support.packing import owner_raster

RESOLUTION, PADDING = 2048, 4
LARGE = 25_000_000  # bytes
FEW = 20  # charts up to which as much is asked as sparrow reaches
SPARROW_UP_TO = 300
WITH_UV = (
    "spot.obj",
    "beast.obj",
    "fuze.obj",
    "maze.obj",
    "bunny10k_textured.ply",
    "SheenCloth.glb",
)


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


def charts_of(path: str) -> Charts:
    """The charts that a file has."""
    from circparam import formats

    uvmap = formats.read(path).uv()
    if uvmap is None:
        raise SystemExit(f"{path}: no uv, so no charts to pack")
    return Charts.of(f"{Path(path).name} (its own)", uvmap)


@dataclass(frozen=True, eq=False)
class Peers:
    """Other packers. sparrow: the Python that has it, None for none. seconds: bound on xatlas, and what sparrow
    is given. known: file with figures by the charts they are of."""

    sparrow: str | None
    seconds: dict[str, float]
    known: Path | None

    def figures(self, name: str, charts: Charts) -> dict[str, Any] | None:
        """Covered share and what the peer says; None where it did not end in time or failed."""
        seconds = self.seconds[name]
        given = {"faces": charts.faces, "uv": charts.uv, "chart": charts.chart, "seconds": seconds}
        digest = hashlib.sha256(name.encode())
        for value in given.values():
            digest.update(np.ascontiguousarray(value).tobytes())
        table = json.loads(self.known.read_text()) if self.known and self.known.exists() else {}
        key = digest.hexdigest()[:16]
        if key not in table:
            table[key] = self._run(name, given)
            if self.known:
                self.known.write_text(json.dumps(table))
        found: dict[str, Any] | None = table[key]
        return found

    def _run(self, name: str, given: dict[str, Any]) -> dict[str, Any] | None:
        python = self.sparrow if name == "sparrow" else sys.executable
        script = Path(__file__).with_name("pack_peers.py")
        with tempfile.TemporaryDirectory() as folder:
            source, target = f"{folder}/in.npz", f"{folder}/out.npz"
            np.savez(source, resolution=RESOLUTION, padding=PADDING, **given)
            command = [str(python), str(script), name, source, target]
            bound = 10 * self.seconds[name] if name == "sparrow" else self.seconds[name]
            try:
                done = subprocess.run(command, capture_output=True, text=True, timeout=bound)
                said: dict[str, Any] = json.loads(done.stdout)
            except (subprocess.TimeoutExpired, ValueError):
                return None
            with np.load(target) as out:
                corners = out["uv"][out["faces"]] * RESOLUTION
        grid, _ = owner_raster(corners, np.zeros(len(corners), np.int64), RESOLUTION)
        return {**said, "share": float((grid >= 0).mean())}


def _is_mesh(path: Path) -> bool:
    """Whether a file of the corpus is a mesh that is unwrapped in a minute or so."""
    known = (".obj", ".off", ".ply", ".stl", ".glb")
    return path.suffix.lower() in known and path.stat().st_size < LARGE


def measure(charts: Charts, peers: Peers) -> dict[str, Any]:
    """One row of the table of identical charts."""
    start = time.perf_counter()
    packed = pack(charts.faces, charts.uv, charts.chart, PackOptions(RESOLUTION, PADDING))
    seconds = time.perf_counter() - start
    corners = packed.uv[charts.faces] * RESOLUTION
    grid, _ = owner_raster(corners, charts.chart, RESOLUTION)
    gap, border = smallest_gap(grid, PADDING + 1)[0], free_border(grid)
    count = int(charts.chart.max()) + 1
    nested = peers.sparrow is not None and 1 < count <= SPARROW_UP_TO
    return {
        "file": charts.name,
        "charts": count,
        "ours": float((grid >= 0).mean()),
        "seconds": seconds,
        "kept": gap >= PADDING + 1 and border >= PADDING,
        "xatlas": peers.figures("xatlas", charts),
        "sparrow": peers.figures("sparrow", charts) if nested else None,
    }


def atlas(path: str, only_whole: bool = False) -> tuple[dict[str, Any], Charts]:
    """One mesh unwrapped with charts left whole, and at the defaults; and the whole charts."""
    from circparam import unwrap

    whole = unwrap(path, pack_splits=0)
    charts = Charts.of(Path(path).name, UVMap(whole.uv, whole.uv_faces))
    if only_whole:
        return {}, charts
    full = unwrap(path)
    before, after = whole.measures, full.measures
    seconds = full.seconds
    figures_ = {
        "file": Path(path).name,
        "charts": (before["charts"], after["charts"]),
        "seams": (before["seam_length"], after["seam_length"]),
        "share": (before["pack"], after["pack"]),
        "flat": bool(before["charts"] == 1 and before["seam_length"] == 0),
        "packing": seconds.get("pack", 0.0),
        "seconds": sum(seconds.values()),
    }
    return figures_, charts


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


def report(rows: list[dict[str, Any]]) -> list[str]:
    """Identical charts as a Markdown table, with what is asked of all of them together."""
    cells: list[list[str]] = []
    ratios: dict[str, list[tuple[int, float]]] = {"xatlas": [], "sparrow": []}
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
    beside = [ratio for _, ratio in ratios["xatlas"]]
    if beside:
        lines += [
            Line("ratio to xatlas, mean", float(np.mean(beside)), "", ">= 1.30"),
            Line("ratio to xatlas, least", min(beside), "", ">= 1.05"),
        ]
    for few, wanted in ((True, ">= 1.0"), (False, ">= 0.95")):
        nested = [ratio for n, ratio in ratios["sparrow"] if (n <= FEW) is few]
        if nested:
            which = f"{'up to' if few else 'more than'} {FEW} charts"
            below = sum(ratio < float(wanted.split()[1]) for ratio in nested)
            detail = f"mean {np.mean(nested):.3f}; {below} of {len(nested)} below"
            lines.append(Line(f"ratio to sparrow, {which}, least", min(nested), "", wanted, detail))
    head = ["file", "charts", "circparam share", "s", "padding kept"]
    head += ["xatlas share", "s", "ratio", "sparrow share", "s", "ratio"]
    return [*table(head, cells), "", *figures(lines)]


def _rows(
    chosen: argparse.Namespace, peers: Peers
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of the atlases, and of identical charts."""
    meshes = chosen.files or [str(p) for p in sorted(CORPUS.glob("*")) if _is_mesh(p)]
    atlases, rows = [], []
    for path in meshes:
        figures_, whole = atlas(path, chosen.charts_only)
        if figures_:
            atlases.append(figures_)
            print(figures_, flush=True)
        if not chosen.atlases_only:
            rows.append(measure(whole, peers))
            print(rows[-1], flush=True)
    with_uv = [] if chosen.files else [CORPUS / name for name in WITH_UV]
    for source in [] if chosen.atlases_only else [p for p in with_uv if p.exists()]:
        rows.append(measure(charts_of(str(source)), peers))
        print(rows[-1], flush=True)
    return atlases, rows


def main(arguments: list[str] | None = None) -> int:
    """Measure the files, print the tables and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="meshes; those of the corpus if left out")
    parser.add_argument("--atlases-only", action="store_true", help="nothing beside other packers")
    parser.add_argument("--charts-only", action="store_true", help="only beside other packers")
    parser.add_argument("--no-report", action="store_true", help="print only")
    parser.add_argument(
        "--xatlas-seconds", type=float, default=300.0, help="after which it is ended"
    )
    parser.add_argument("--sparrow", help="a Python that has spyrrow and shapely")
    parser.add_argument("--sparrow-seconds", type=float, default=20.0, help="that it is given")
    parser.add_argument("--known", type=Path, help="file that keeps the figures of other packers")
    chosen = parser.parse_args(arguments)
    seconds = {"xatlas": chosen.xatlas_seconds, "sparrow": chosen.sparrow_seconds}
    atlases, rows = _rows(chosen, Peers(chosen.sparrow, seconds, chosen.known))
    if not atlases and not rows:
        print("no meshes: name some")
        return 0
    parts = [atlas_report(atlases)] if atlases else []
    parts += [report(rows)] if rows else []
    for part in parts:
        print("\n".join(part))
    if not chosen.no_report:
        intro = (
            f"Pages of {RESOLUTION} texels, padding {PADDING}: covered texels as a share of the unit "
            "square. First whole atlases, with `--pack-splits 0` and at the defaults; then identical "
            "charts, those of `--pack-splits 0` and those of files with uv, beside xatlas (`add_uv_mesh`, "
            "bruteForce on a page of 512 with a padding of 1, since at 2048 it does not end in minutes) and "
            f"sparrow ({chosen.sparrow_seconds:g} s of a processor for the strip, and twice a fifth of that "
            "before to find the height at which it is square; outlines without holes, 2 to "
            f"{SPARROW_UP_TO} charts). Written by `make bench-packing`."
        )
        write("packing.md", "Full pages", intro, parts)
    return 0 if all(r["kept"] for r in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
