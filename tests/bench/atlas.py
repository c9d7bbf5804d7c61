"""``make bench-atlas`` and ``make bench-hard``: whole atlases beside peers; docs/benchmarks/atlas.md, hard.md.

    python -m tests.bench atlas [MESH...] [--hard] [--judge SCRIPT] [--peers xatlas,uvatlas,blender]

Meshes: files, or a set of the corpus folder (CIRCPARAM_CORPUS). --hard: hard surfaces and the machine parts of
tests/support, beside xatlas alone. Each is unwrapped at the default bound, by every peer, and at the distortion
that the peer reached, at least 1.01. In flats: seams between faces within half a degree, over √(surface area).
"""

import tempfile
from dataclasses import dataclass
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
    "armadillo.obj": {"charts": 13, "seam_length": 6.2},
    "igea.ply": {"charts": 3, "seam_length": 2.7},
    "ogre.obj": {"charts": 143, "seam_length": 12.3},
    "tower_holes.obj": {"charts": 8, "seam_length": 4.9},
    "spm152_iso.ply": {"gigabytes": 3},
    "beast.obj": {}, "teapot.obj": {}, "counter.unitsmm.STL": {}, "CesiumMilkTruck.glb": {},
}  # fmt: skip
HARD = (
    "counter.unitsmm.STL", "featuretype.STL", "fandisk.obj", "thingi10k_1514499.stl", "CesiumMilkTruck.glb",
    "truck.obj", "chair_model.obj", "tower_holes.obj", "3holes.off", "fuze.obj",
)  # fmt: skip
# most of the median ratio to a peer at its distortion
BESIDE = {
    "xatlas": {"seam_length": 0.65, "charts": 0.35},
    "uvatlas": {"seam_length": 0.8, "charts": 0.6},
}
BESIDE_HARD = {"xatlas": {"seam_length": 0.7, "charts": 0.5}}
MOST_IN_FLATS = 0.3  # of a hard surface, over √(surface area)
FLAT = np.cos(np.radians(0.5))  # of the angle between two faces of one flat
NEEDLE = 1e-7  # area over the square of the longest edge, below which a face has no normal
COLUMNS = {
    "charts": "{charts}", "seam": "{seam_length:.2f}", "in flats": "{flat:.2f}", "SD/4": "{sd:.5g}",
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

    @property
    def rows(self) -> list[list[str]]:
        """The cells of each atlas."""
        at = {f"circparam at {name}'s": a for name, a in self.beside.items()}
        named = {"circparam": self.default, **self.peers, **at}.items()
        bounds = {who: "" if a.bound is None else f"{a.bound:.4g}" for who, a in named}
        head = [self.name, str(self.faces)]
        return [[*head, who, bounds[who], *a.cells(*COLUMNS.values())] for who, a in named]


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


def measure(path: Path, names: list[str], bench: Bench) -> Run:
    """One mesh by all, printed as soon as it is there."""
    faces = len(formats.read(path).mesh.faces)
    peers = {name: bench.peer(name, path) for name in names}
    beside = {n: bench.beside(a, path) for n, a in peers.items() if a.ok and n != "blender"}
    run = Run(path.name, faces, bench.unwrap(path, BOUND), peers, beside)
    for atlas in (run.default, *peers.values(), *beside.values()):
        if atlas.path is not None:
            atlas.figures["flat"] = in_flats(atlas.path)
    print(*map(" | ".join, run.rows), sep="\n", flush=True)
    return run


def verdicts(runs: list[Run], hard: bool) -> list[Line]:
    """What is wanted of the whole set, and of single meshes."""
    every = [a for r in runs for a in (r.default, *r.beside.values())]
    broken = [a for a in every if not a.ok or not a.clean()]
    above = [a for a in every if a.ok and a.figures["sd_chart_max"] > (a.bound or 0) * (1 + 1e-4)]
    what = "atlases with flips, mirrored charts, overlap or uv outside, or none at all"
    lines = [Line(what, len(broken), "", "<= 0")]
    lines += [Line("atlases with a chart above the bound", len(above), "", "<= 0")]
    flat = [r.default.figures["flat"] for r in runs if r.default.ok]
    if hard and flat:
        lines.append(Line("seam in flats, largest", max(flat), "", f"<= {MOST_IN_FLATS}"))
    for peer, goals in (BESIDE_HARD if hard else BESIDE).items():
        pairs = [(r.beside[peer], r.peers[peer]) for r in runs if peer in r.beside]
        for key, goal in goals.items():
            found, name = ratios(pairs, key), f"{key} / {peer}'s at its distortion"
            if found:
                lines += [line_of(name, found, "median", f"<= {goal}")]
                lines += [line_of(name, found, "worst", "<= 1")]
    for run in () if hard else (r for r in runs if r.default.ok):
        found = run.default.figures | {"gigabytes": run.default.peak or 0.0}
        goals = GOALS.get(run.name, {}).items()
        lines += [Line(f"{run.name}: {k}", found[k], "", f"<= {v:g}") for k, v in goals]
    return lines


def main() -> None:
    """Run the set."""
    parser = arguments(__doc__, "xatlas,uvatlas,blender,uvunwrap")
    parser.add_argument("--hard", action="store_true", help="the set of hard surfaces")
    chosen = parser.parse_args()
    meshes, names = parsed(parser, chosen, HARD if chosen.hard else GOALS, made=chosen.hard)
    names = ["xatlas"] if chosen.hard else names
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), chosen.judge)
        made = parts(bench.folder) if chosen.hard and not chosen.meshes else []
        runs = [measure(path, names, bench) for path in [*meshes, *made]]
        blocks = [wanted(verdicts(runs, chosen.hard))]
    head = ["mesh", "faces", "who", "bound", *COLUMNS]
    blocks.append(section("All atlases", common.table(head, [row for r in runs for row in r.rows])))
    if chosen.no_report or chosen.meshes:
        return
    kind = "hard" if chosen.hard else "atlas"
    by = "an independent judge" if chosen.judge else "circparam's own verification"
    intro = (
        f"Made by `make bench-{kind}`; figures of the written files, read by {by}. Seam: length of all seams / "
        "√(surface area); in flats: of it between faces within half a degree. SD/4: symmetric Dirichlet energy "
        "of the atlas at its best scale; worst chart: of one chart at that scale, which --max-distortion "
        "bounds. Seconds without reading and writing."
    )
    title = "Hard surfaces beside xatlas" if chosen.hard else "Atlases beside others"
    common.write(f"{kind}.md", title, intro, blocks)
