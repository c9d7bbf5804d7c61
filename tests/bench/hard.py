"""``make bench-hard``: hard surfaces beside xatlas; writes docs/benchmarks/hard.md.

    python -m tests.bench hard [MESH...] [--judge SCRIPT] [--no-report]

Meshes: files, or the hard set of the corpus folder (CIRCPARAM_CORPUS) and the machine parts that
tests/support/parts.py and machined.py make. Every mesh is unwrapped at the default bound, by xatlas, and at
the distortion that xatlas reached (at least 1.01). In flats: seams between faces within half a degree, over
√(surface area). Figures are those of the written files, as in ``tests.bench.atlas``.
"""

import argparse
import os
import statistics
import tempfile
from pathlib import Path

import numpy as np

from circparam import formats
from circparam.mesh.repair import repair
from circparam.pipeline.verify import uv_seams
from tests.bench import atlas, common
from tests.bench.common import Line, say
from tests.support.corpus import CORPUS
from tests.support.machined import MACHINED
from tests.support.parts import PARTS

SET = (
    "counter.unitsmm.STL", "featuretype.STL", "fandisk.obj", "thingi10k_1514499.stl", "CesiumMilkTruck.glb",
    "truck.obj", "chair_model.obj", "tower_holes.obj", "3holes.off", "fuze.obj",
)  # fmt: skip
FLAT = np.cos(np.radians(0.5))  # of the angle between two faces of one flat
NEEDLE = 1e-7  # area over the square of the longest edge, below which a face has no normal


def in_flats(path: Path) -> float:
    """Length of the seams of a written file that run inside flats, over √(surface area)."""
    document = formats.read(path)
    surface, _ = repair(document.mesh)
    uvmap = document.uv()
    if uvmap is None:
        raise SystemExit(f"{path} has no uv")
    p = surface.rest_triangles
    longest = ((p[:, [1, 2, 0]] - p) ** 2).sum(2).max(1)
    sure = surface.areas > NEEDLE * longest
    i, j = surface.edges[:, 0] // 3, surface.edges[:, 1] // 3
    flat = (surface.normals[i] * surface.normals[j]).sum(1) > FLAT
    seam = uv_seams(surface, uvmap) & flat & sure[i] & sure[j]
    return float(surface.edge_lengths[seam].sum() / np.sqrt(surface.areas.sum()))


def parts(folder: Path) -> list[Path]:
    """The generated parts as OBJ files, with points that coincide not merged, as STL has them."""
    out = []
    for name, make in {**PARTS, **MACHINED}.items():
        part = make()
        path = folder / f"{name.replace(' ', '-')}.obj"
        with path.open("w") as stream:
            np.savetxt(stream, part.points, fmt="v %.17g %.17g %.17g")
            np.savetxt(stream, part.faces + 1, fmt="f %d %d %d")
        out.append(path)
    return out


def row(path: Path, folder: Path, judge: Path | None) -> tuple[list[str], dict[str, float]]:
    """The cells of a mesh, and its figures for the verdicts."""
    limit = 180.0
    default = atlas.unwrap(path, folder, judge, atlas.BOUND, limit)
    peer = atlas.peer("xatlas", path, folder, judge, limit)
    cells, figures = [path.stem], {}
    # a collapsed face makes the figure a number without meaning: then the strictest bound
    sane = peer.ok and peer.figures["sd"] < atlas.ABSURD
    bound = max(1.01, peer.figures["sd"]) if sane else 1.01
    beside = atlas.unwrap(path, folder, judge, bound, limit)
    files = (f"{path.stem}-{atlas.BOUND:.4f}", f"{path.stem}-xatlas", f"{path.stem}-{bound:.4f}")
    for name, made, file in zip(
        ("default", "xatlas", "beside"), (default, peer, beside), files, strict=True
    ):
        if not made.ok:
            cells += [f"failed: {made.why}", "", "", "", ""]
            continue
        f, flat = made.figures, in_flats(folder / f"{file}.obj")
        cells += [
            str(f["charts"]), f"{f['seam_length']:.2f}", f"{flat:.2f}", f"{f['sd']:.5g}", f"{made.seconds:.1f}"
        ]  # fmt: skip
        figures |= {f"{name} {k}": f[k] for k in ("charts", "seam_length")}
        figures |= {f"{name} flat": flat, f"{name} clean": float(made.clean())}
    return cells, figures


def verdicts(found: list[dict[str, float]]) -> list[Line]:
    """What was wanted of the whole set, as figures."""
    both = [f for f in found if "beside charts" in f and f.get("xatlas seam_length", 0) > 0]
    seam = [f["beside seam_length"] / f["xatlas seam_length"] for f in both]
    charts = [f["beside charts"] / f["xatlas charts"] for f in both]
    flat = [f["default flat"] for f in found if "default flat" in f]
    dirty = sum(
        not v for f in found for k, v in f.items() if k in ("default clean", "beside clean")
    )
    return [
        Line("atlases with flips, mirrored charts or overlap", dirty, "", "<= 0"),
        Line("seam in flats, largest", max(flat), "", "<= 0.3"),
        Line("seam / xatlas' at its distortion, median", statistics.median(seam), "", "<= 0.7"),
        Line("seam / xatlas' at its distortion, worst", max(seam), "", "<= 1"),
        Line("charts / xatlas' at its distortion, median", statistics.median(charts), "", "<= 0.5"),
    ]


def main() -> None:
    """Run the set."""
    parser = argparse.ArgumentParser(description="Hard surfaces beside xatlas.")
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--judge", type=Path, default=os.environ.get("CIRCPARAM_JUDGE") or None)
    parser.add_argument("--no-report", action="store_true")
    chosen = parser.parse_args()
    print("\n".join(common.machine()), flush=True)
    rows, found = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        meshes = chosen.meshes or [
            *(CORPUS / n for n in SET if (CORPUS / n).exists()),
            *parts(folder),
        ]
        for path in meshes:
            cells, figures = row(path, folder, chosen.judge)
            print(" | ".join(cells), flush=True)
            rows.append(cells)
            found.append(figures)
    lines = verdicts(found)
    for line in lines:
        say(line)
    if chosen.no_report or chosen.meshes:
        return
    head = ["mesh"]
    for who in ("", "xatlas ", "at its distortion: "):
        head += [f"{who}charts", "seam", "in flats", "SD/4", "s"]
    intro = (
        "Made by `make bench-hard`; figures of the written files. Seam: length of all seams / √(surface area); "
        "in flats: of it between faces within half a degree. Seconds without reading and writing."
    )
    blocks = [
        ["## Wanted and measured", "", *common.figures(lines)],
        ["## All meshes", "", *common.table(head, rows)],
    ]
    print(f"written: {common.write('hard.md', 'Hard surfaces beside xatlas', intro, blocks)}")


if __name__ == "__main__":
    main()
