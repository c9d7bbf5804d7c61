"""``make bench-speed``: how long whole atlases take beside peers in one run; writes docs/benchmarks/speed.md.

    python -m tests.bench speed [MESH...] [--peers xatlas,uvatlas]

Meshes: files, or all of the corpus folder (CIRCPARAM_CORPUS) when none is given. Compared are the stages
without reading and writing with the compute time that a peer tells of itself, each in a process of its own.
Imports are no part of either. A peer has a minute (``LIMITS``) for a mesh, and UVAtlas is run below 20,000
faces alone: so a whole run takes some 20 minutes. A peer that did not end counts with its limit, so ratios are
too high then. The profile (of a fixed set, or of the meshes named) tells which functions of this package the
processor was in, worker processes left out.
"""

import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from circparam import formats
from circparam.core import own_process
from circparam.samples import samples
from tests.bench import common
from tests.bench.atlases import Atlas, Bench, arguments, parsed
from tests.bench.common import Line, section, wanted
from tests.support.corpus import CORPUS, SUFFIXES

PROFILED = (
    "spot.obj", "cow.obj", "rocker-arm.obj", "boot.obj", "stanford-bunny.obj", "ogre.obj", "CesiumMan.glb",
    "bunny_1hole.obj", "fuze.obj",
)  # fmt: skip
LARGE = 20_000  # faces from which on other things are wanted
SLOW = 2.0  # seconds of xatlas: from there on, on large meshes, it is never to be faster
TIMES, FREE = 15.0, 0.6  # what a small mesh may take: so often xatlas' time, and seconds for free
MOST = {"counter": 4.0}  # seconds
WANTED = {"stanford-bunny": 0.2, "armadillo": 0.5, "ogre": 1.0, "boot": 1.0}  # of xatlas' time
MEDIANS = {"xatlas": 4.0, "uvatlas": 0.12}  # of a peer's time, below LARGE faces
LIMITS = {"xatlas": 60.0, "uvatlas": 45.0}  # seconds of a peer: what takes longer is known to
UP_TO = {"uvatlas": LARGE}  # faces from which on a peer is not run, as nothing is asked beside it
SHOWN_STAGE, SHOWN_FUNCTION = 0.05, 0.01  # shares of the whole from which on they are shown
ENDS = ("ended", "limit", "failed", "not run")


@dataclass
class Run:
    """One mesh: our atlas, and those of the peers by name."""

    name: str
    faces: int
    own: Atlas
    peers: dict[str, Atlas]

    def ratio(self, peer: str) -> float | None:
        """Our time over that of a peer; too high where it was ended at its limit."""
        other = self.peers.get(peer)
        return self.own.seconds / other.seconds if other is not None and other.seconds else None

    def times(self) -> str:
        """Our time and that of xatlas."""
        return f"{self.own.seconds:.2f} s / {cell(self.peers['xatlas'])} s, {self.faces} faces"


def cell(peer: Atlas) -> str:
    """The seconds of a peer, or how it ended."""
    sign = "> " if peer.status == "limit" else ""
    return f"{sign}{peer.seconds:.2f}" if peer.seconds else peer.status


def measure(path: Path, names: list[str], bench: Bench) -> Run:
    """One mesh by all, printed as soon as it is there."""
    run = Run(path.stem.split(".")[0], len(formats.read(path).mesh.faces), bench.unwrap(path), {})
    for name in names if run.own.ok else ():
        few = run.faces < UP_TO.get(name, run.faces + 1)
        made = bench.peer(name, path, LIMITS.get(name)) if few else Atlas(name, status="not run")
        run.peers[name] = made
    print(*(row(run) if run.own.ok else [path.name, run.own.why]), sep="  ", flush=True)
    return run


def verdicts(runs: list[Run]) -> list[Line]:
    """What is wanted of the set."""
    lines = []
    small = [r for r in runs if r.faces < LARGE]
    for peer, goal in MEDIANS.items():
        known = sorted(x for r in small if (x := r.ratio(peer)) is not None)
        if known:
            ended = sum(r.peers[peer].status == "limit" for r in small)
            detail = f"{len(known)} of {len(small)} meshes, {ended} of them at the peer's limit"
            name = f"below {LARGE} faces, time / {peer}'s, median"
            lines.append(Line(name, known[len(known) // 2], "", f"<= {goal:g}", detail))
    beside = {r.name: r for r in runs if r.ratio("xatlas") is not None}
    allowed = {n: max(TIMES * r.peers["xatlas"].seconds, FREE) for n, r in beside.items()}
    above = [r for n, r in beside.items() if r in small and r.own.seconds > allowed[n]]
    name = f"below {LARGE} faces, meshes above {TIMES:g} x xatlas' time and {FREE:g} s"
    lines.append(Line(name, len(above), "", "<= 0", f"of {len(small)}"))
    for r in above:
        goal = f"<= {allowed[r.name]:.2f}"
        lines.append(Line(f"{r.name}: seconds", r.own.seconds, "s", goal, r.times()))
    for name, r in beside.items():
        if r.faces >= LARGE and (name in WANTED or r.peers["xatlas"].seconds > SLOW):
            goal = f"<= {WANTED.get(name, 1.0):g}"
            ratio = r.ratio("xatlas") or 0.0
            lines.append(Line(f"{name}: time / xatlas'", ratio, "", goal, r.times()))
    most = [(r.name, r.own.seconds, f"<= {MOST[r.name]:g}") for r in runs if r.name in MOST]
    return lines + [Line(f"{name}: seconds", took, "s", goal) for name, took, goal in most]


def row(run: Run) -> list[str]:
    """The cells of a mesh."""
    cells = []
    for name, peer in run.peers.items():
        ratio, sign = run.ratio(name), "< " if peer.status == "limit" else ""
        cells += [cell(peer), "–" if ratio is None else f"{sign}{ratio:.2f}"]
    stages = sorted(run.own.stages.items(), key=lambda kv: -kv[1])
    least = SHOWN_STAGE * run.own.seconds
    most = ", ".join(f"{k} {v:.2f}" for k, v in stages if v >= least)
    return [run.name, str(run.faces), f"{run.own.seconds:.2f}", *cells,
            *run.own.cells("{charts}", "{seam_length:.2f}"), most]  # fmt: skip


def hot_spots(path: Path, folder: Path) -> list[str]:
    """The name of a mesh, and the functions that the processor was in most, with their shares of the time."""
    settings = {"path": str(path), "out": str(folder / f"{path.stem}.obj")}
    done = own_process.run("tests.bench.tasks:profile", {}, settings)
    if done.error is not None:
        raise SystemExit(f"{path.name}: {done.error}")
    shares = [(f, s) for f, s in done.info["shares"] if s >= SHOWN_FUNCTION]
    print(path.stem, text := ", ".join(f"{f} {100 * s:.0f} %" for f, s in shares[:12]), flush=True)
    return [path.stem, text]


INTRO = (
    "Made by `make bench-speed`: seconds of all stages without reading and writing, on all cores, beside "
    "the compute time that a peer tells of itself, in one run; imports are no part of either. A peer that did "
    "not end within its limit counts with the limit, so the ratio is an upper bound (`<`); one that failed "
    "counts nowhere. What the atlases of the peers are worth: [atlas.md](atlas.md). Hot spots: functions of "
    "this package in which a process without helpers spends its time, what they call outside the package "
    "included."
)


def main() -> None:
    """Run the set."""
    parser = arguments(__doc__, "xatlas,uvatlas")
    every = sorted(CORPUS.iterdir()) if CORPUS.is_dir() else []
    chosen = parser.parse_args()
    whole = [p.name for p in every if p.suffix.lower() in SUFFIXES]
    meshes, names = parsed(parser, chosen, whole)
    start, load = time.monotonic(), f"- load when it began: {os.getloadavg()[0]:.1f}"
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(Path(name))
        # as installed: compiled once. In a checkout that must stay clean it would be compiled each time.
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        os.environ["PYTHONPYCACHEPREFIX"] = str(bench.folder / "compiled")
        bench.unwrap(samples.path("ribbon"))
        tried = [measure(path, names, bench) for path in meshes]
        runs = sorted((r for r in tried if r.own.ok), key=lambda r: r.faces)
        picked = chosen.meshes or [p for p in meshes if p.name in PROFILED]
        hot = [hot_spots(p, bench.folder) for p in picked]
        rows = [row(r) for r in runs]
    failed = ", ".join(r.name for r in tried if not r.own.ok)
    took = f"- the whole run took {(time.monotonic() - start) / 60:.1f} minutes"
    took += f"; no atlas of {failed}" if failed else ""
    print(load, took, sep="\n")
    asked = wanted(verdicts(runs))
    if chosen.no_report:
        return
    ends = [[n, *(str(sum(r.peers[n].status == how for r in runs)) for how in ENDS)] for n in names]
    head = ["mesh", "faces", "s", *[x for n in names for x in (f"{n} s", f"/ {n}")]]
    head += ["charts", "seam", "stages of 5 % and more, s"]
    blocks = [
        [load, took],
        asked,
        section("Peers", common.table(["peer", "ended", "at its limit", *ENDS[2:]], ends)),
        section("All meshes", common.table(head, rows)),
        section("Hot spots", common.table(["mesh", "functions"], hot)),
    ]
    title = "Speed of whole atlases"
    common.write("speed.md", title, INTRO, blocks)
