"""``make bench-hard``: hard surfaces beside xatlas; writes docs/benchmarks/hard.md.

    python -m tests.bench hard [MESH...] [--judge SCRIPT] [--no-report]

Meshes: files, or the hard set of the corpus folder (CIRCPARAM_CORPUS) and the machine parts of tests/support.
Every mesh is unwrapped at the default bound, by xatlas, and at the distortion that xatlas reached (at least
1.01). In flats: seams between faces within half a degree, over √(surface area); see ``tests/bench/atlases.py``.
"""

import tempfile
from pathlib import Path

import numpy as np

from circparam import formats
from circparam.mesh.repair import repair
from circparam.pipeline.verify import uv_seams
from tests.bench import common
from tests.bench.atlases import BOUND, Atlas, Bench, arguments, line_of, parsed, ratios
from tests.bench.common import Line, section, wanted
from tests.support.machined import MACHINED
from tests.support.parts import PARTS
from tests.support.writers import obj

SET = (
    "counter.unitsmm.STL", "featuretype.STL", "fandisk.obj", "thingi10k_1514499.stl", "CesiumMilkTruck.glb",
    "truck.obj", "chair_model.obj", "tower_holes.obj", "3holes.off", "fuze.obj",
)  # fmt: skip
FLAT = np.cos(np.radians(0.5))  # of the angle between two faces of one flat
NEEDLE = 1e-7  # area over the square of the longest edge, below which a face has no normal
SIDES = ("default", "xatlas", "beside")
COLUMNS = ("{charts}", "{seam_length:.2f}", "{flat:.2f}", "{sd:.5g}", "{seconds:.1f}")


def in_flats(path: Path) -> float:
    """Length of the seams of a written file that run inside flats, over √(surface area)."""
    document = formats.read(path)
    surface, _ = repair(document.mesh)
    p = surface.rest_triangles
    longest = ((p[:, [1, 2, 0]] - p) ** 2).sum(2).max(1)
    sure = surface.areas > NEEDLE * longest
    i, j = surface.edges[:, 0] // 3, surface.edges[:, 1] // 3
    flat = (surface.normals[i] * surface.normals[j]).sum(1) > FLAT
    seam = uv_seams(surface, document.uv()) & flat & sure[i] & sure[j]
    return float(surface.edge_lengths[seam].sum() / np.sqrt(surface.areas.sum()))


def parts(folder: Path) -> list[Path]:
    """The generated parts as OBJ files."""
    out = []
    for name, make in (PARTS | MACHINED).items():
        out.append(folder / f"{name.replace(' ', '-')}.obj")
        part = make()
        out[-1].write_bytes(obj(part.points, part.faces))
    return out


def measure(path: Path, bench: Bench) -> dict[str, Atlas]:
    """One mesh, by the names of SIDES."""
    peer = bench.peer("xatlas", path)
    found = dict(
        zip(SIDES, (bench.unwrap(path, BOUND), peer, bench.beside(peer, path)), strict=True)
    )
    for atlas in found.values():
        if atlas.ok:
            atlas.figures["flat"] = in_flats(atlas.path)
    return found


def verdicts(runs: list[dict[str, Atlas]]) -> list[Line]:
    """What is wanted of the whole set."""
    own = [r[side] for r in runs for side in ("default", "beside") if r[side].ok]
    flat = [r["default"].figures["flat"] for r in runs if r["default"].ok]
    pairs = [(r["beside"], r["xatlas"]) for r in runs]
    seam, charts = ratios(pairs, "seam_length"), ratios(pairs, "charts")
    dirty = sum(not atlas.clean() for atlas in own)
    lines = [Line("atlases with flips, mirrored charts or overlap", dirty, "", "<= 0")]
    lines += [Line("seam in flats, largest", max(flat), "", "<= 0.3")] if flat else []
    if seam:
        lines += [line_of("seam / xatlas' at its distortion", seam, "median", "<= 0.7")]
        lines += [line_of("seam / xatlas' at its distortion", seam, "worst", "<= 1")]
        lines += [line_of("charts / xatlas' at its distortion", charts, "median", "<= 0.5")]
    return lines


def main() -> None:
    """Run the set."""
    chosen, meshes, _ = parsed(arguments(__doc__, "xatlas"), SET, made=True)
    rows, runs = [], []
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), chosen.judge)
        for path in meshes if chosen.meshes else [*meshes, *parts(bench.folder)]:
            runs.append(measure(path, bench))
            rows.append([path.stem, *(c for a in runs[-1].values() for c in a.cells(*COLUMNS))])
            print(" | ".join(rows[-1]), flush=True)
    blocks = [wanted(verdicts(runs))]
    if chosen.no_report or chosen.meshes:
        return
    head = ["mesh"]
    for who in ("", "xatlas ", "at its distortion: "):
        head += [f"{who}charts", "seam", "in flats", "SD/4", "s"]
    intro = (
        "Made by `make bench-hard`; figures of the written files. Seam: length of all seams / √(surface area); "
        "in flats: of it between faces within half a degree. Seconds without reading and writing."
    )
    blocks.append(section("All meshes", common.table(head, rows)))
    print(f"written: {common.write('hard.md', 'Hard surfaces beside xatlas', intro, blocks)}")


if __name__ == "__main__":
    main()
