"""``make bench-atlas``: whole atlases beside xatlas, UVAtlas and Blender; writes docs/benchmarks/atlas.md.

    python -m tests.bench atlas [MESH...] [--judge SCRIPT] [--peers xatlas,uvatlas,blender]

Meshes: files, or the set of the corpus folder (CIRCPARAM_CORPUS) when none is given. Each is unwrapped at the
default bound, by every peer, and at the distortion that the peer reached; see ``tests/bench/atlases.py``.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from circparam import formats
from tests.bench import common
from tests.bench.atlases import BOUND, Atlas, Bench, arguments, line_of, parsed, ratios
from tests.bench.common import Line, section, wanted

# most of each figure at the default bound; charts and seam length: what an earlier prototype reached
GOALS: dict[str, dict[str, float]] = {
    "spot.obj": {"charts": 6, "seam_length": 5.3},
    "cow.obj": {"charts": 14, "seam_length": 7.6},
    "fandisk.obj": {"charts": 2, "seam_length": 2.9},
    "rocker-arm.obj": {"charts": 3, "seam_length": 3.5},
    "3holes.off": {"charts": 1, "seam_length": 4.6},
    "fertility.off": {"charts": 4, "seam_length": 6.2},
    "boot.obj": {"charts": 11, "seam_length": 6.7},
    "stanford-bunny.obj": {"charts": 4, "seam_length": 4.0},
    "armadillo.obj": {"charts": 13, "seam_length": 6.2, "seconds": 15},
    "igea.ply": {"charts": 3, "seam_length": 2.7, "seconds": 15},
    "ogre.obj": {"charts": 143, "seam_length": 12.3, "seconds": 25},
    "beast.obj": {},
    "teapot.obj": {},
    "tower_holes.obj": {"charts": 8, "seam_length": 4.9},
    "counter.unitsmm.STL": {},
    "CesiumMilkTruck.glb": {},
    "spm152_iso.ply": {"seconds": 150, "gigabytes": 3},
}
LARGE = (
    30_000  # faces from which on a time is compared with that of xatlas; below, it is 5 s at most
)
SOONER = {"stanford-bunny.obj": 3.0}  # xatlas' time over ours, at least; 1 for other large meshes
BESIDE = {
    "xatlas": {"seam_length": 0.65, "charts": 0.35},
    "uvatlas": {"seam_length": 0.8, "charts": 0.6},
}
COLUMNS = {
    "charts": "{charts}", "seam": "{seam_length:.2f}", "SD/4": "{sd:.5g}",
    "worst chart": "{sd_chart_max:.5g}", "flips": "{flips}", "mirrored": "{mirrored_charts}",
    "overlap": "{overlap:.1g}", "pack": "{pack:.3f}", "s": "{seconds:.2f}",
}  # fmt: skip


@dataclass
class Run:
    """One mesh: circparam at its default bound, the peers, and circparam at the distortion of each."""

    name: str
    faces: int
    default: Atlas
    peers: dict[str, Atlas]
    beside: dict[str, Atlas]


def measure(path: Path, names: list[str], bench: Bench) -> Run:
    """One mesh by all, each printed as soon as it is there."""
    faces = len(formats.read(path).mesh.faces)
    print(f"{path.name} ({faces} faces)", flush=True)
    run = Run(path.name, faces, bench.unwrap(path, BOUND), {}, {})
    print(f"  {run.default}", flush=True)
    for name in names:
        run.peers[name] = bench.peer(name, path)
        print(f"  {run.peers[name]}", flush=True)
        if run.peers[name].ok and name != "blender":
            run.beside[name] = bench.beside(run.peers[name], path)
            print(f"  at its distortion: {run.beside[name]}", flush=True)
    return run


def verdicts(runs: list[Run]) -> list[Line]:
    """What is wanted of the whole set, and of single meshes."""
    every = [a for r in runs for a in (r.default, *r.beside.values())]
    broken = [a for a in every if not a.ok or not a.clean()]
    bound = [(a.figures["sd_chart_max"], a.bound or 0.0) for a in every if a.ok]
    above = [sd for sd, bound in bound if sd > bound * (1 + 1e-4)]
    what = "atlases with flips, mirrored charts, overlap or uv outside, or none at all"
    lines = [Line(what, len(broken), "", "<= 0")]
    lines += [Line("atlases with a chart above the bound", len(above), "", "<= 0")]
    for peer, goals in BESIDE.items():
        pairs = [(r.beside[peer], r.peers[peer]) for r in runs if peer in r.beside]
        for key, goal in goals.items():
            found, name = ratios(pairs, key), f"{key} / {peer}'s at its distortion"
            if found:
                lines += [line_of(name, found, "median", f"<= {goal}")]
                lines += [line_of(name, found, "worst", "<= 1")]
    return lines + [line for r in runs if r.default.ok for line in of_mesh(r)]


def of_mesh(run: Run) -> list[Line]:
    """Its time beside that of xatlas, and its goals."""
    own, lines = run.default, []
    peer = run.peers.get("xatlas")
    if peer is not None and peer.ok and run.faces >= LARGE:
        detail = f"{peer.seconds:.1f} s / {own.seconds:.1f} s"
        goal = f">= {SOONER.get(run.name, 1.0):g}"
        ratio = peer.seconds / own.seconds
        lines.append(Line(f"{run.name}: xatlas' time / circparam's", ratio, "", goal, detail))
    goals = dict(GOALS.get(run.name, {}))
    if run.faces < LARGE:
        goals.setdefault("seconds", 5.0)
    found = own.figures | {"seconds": own.seconds, "gigabytes": own.peak or 0.0}
    return lines + [Line(f"{run.name}: {k}", found[k], "", f"<= {v:g}") for k, v in goals.items()]


def rows(runs: list[Run]) -> list[list[str]]:
    """A row an atlas."""
    out = []
    for r in runs:
        at = {f"circparam at {name}'s": a for name, a in r.beside.items()}
        for who, a in {"circparam": r.default, **r.peers, **at}.items():
            bound = "" if a.bound is None else f"{a.bound:.4g}"
            out.append([r.name, str(r.faces), who, bound, *a.cells(*COLUMNS.values())])
    return out


def main() -> None:
    """Run the set."""
    parser = arguments(__doc__, "xatlas,uvatlas,blender,uvunwrap")
    chosen, meshes, names = parsed(parser, GOALS)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), chosen.judge)
        runs = [measure(path, names, bench) for path in meshes]
        blocks = [wanted(verdicts(runs))]
        head = ["mesh", "faces", "who", "bound", *COLUMNS]
        blocks.append(section("All atlases", common.table(head, rows(runs))))
    if chosen.no_report or chosen.meshes:
        return
    by = "an independent judge" if chosen.judge else "circparam's own verification"
    intro = (
        f"Made by `make bench-atlas`; figures of the written files, read by {by}. Seam: length of all seams / "
        "√(surface area). SD/4: symmetric Dirichlet energy of the atlas at its best scale; worst chart: of one "
        "chart at that scale, which --max-distortion bounds. Seconds without reading and writing."
    )
    print(f"written: {common.write('atlas.md', 'Atlases beside others', intro, blocks)}")


if __name__ == "__main__":
    main()
