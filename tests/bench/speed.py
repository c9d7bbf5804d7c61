"""``make bench-speed``: how long whole atlases take beside peers in one run; writes docs/benchmarks/speed.md.

    python -m tests.bench.speed [MESH...] [--peers xatlas,uvatlas] [--profile N] [--report FOLDER]

Meshes: files, or all of the corpus folder (CIRCPARAM_CORPUS) when none is given. Compared are the stages
without reading and writing with the compute time that a peer tells of itself, each in a process of its own.
Imports are no part of either. A peer has a minute (``LIMITS``) for a mesh, and UVAtlas is run below 20,000
faces alone, which is what is asked of it: so a whole run takes some 20 minutes. What a peer did not end is
told, and its limit stands for its time in ratios, which are too high then. The profile (of a fixed set, or of
the meshes named) tells which functions of this package the processor was in, worker processes left out.
Peers run under the Python that has them, as in ``atlas``.
"""

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from circparam import formats
from circparam.compare import process
from circparam.errors import CircparamError
from circparam.samples import samples
from tests.bench import common
from tests.bench.atlas import PYTHONS, peer_process
from tests.bench.common import Line, say
from tests.support.corpus import CORPUS

SUFFIXES = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf")
PROFILED = (
    "spot.obj", "cow.obj", "rocker-arm.obj", "boot.obj", "stanford-bunny.obj", "ogre.obj", "CesiumMan.glb",
    "bunny_1hole.obj", "fuze.obj",
)  # fmt: skip
LARGE = 20_000  # faces from which on other things are wanted
SLOW = 2.0  # seconds of xatlas: from there on, on large meshes, it is never to be faster
FREE = 0.6  # seconds that no ratio is taken of
MOST = {"counter": 4.0}  # seconds
WANTED = {"stanford-bunny": 0.2, "armadillo": 0.5, "ogre": 1.0, "boot": 1.0}
LIMIT = 300.0  # seconds of this package for a mesh
LIMITS = {"xatlas": 60.0, "uvatlas": 45.0}  # of a peer: what takes longer is known to
UP_TO = {
    "uvatlas": LARGE
}  # faces from which on a peer is not run: nothing is asked beside it there
# a stage is shown where it takes this share of the whole, and a function where it does
SHOWN = 0.01


@dataclass(frozen=True)
class Peer:
    """What a peer took. seconds: None where there is no saying. how: ended, limit (it was ended), failed or
    not run."""

    seconds: float | None
    how: str

    @property
    def cell(self) -> str:
        """For a table."""
        sign = "> " if self.how == "limit" else ""
        return self.how if self.seconds is None else f"{sign}{self.seconds:.2f}"


@dataclass
class Run:
    """One mesh: stages in seconds, what the atlas is, what each peer took."""

    name: str
    faces: int
    stages: dict[str, float]
    figures: dict[str, Any]
    peers: dict[str, Peer] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """All stages but reading and writing."""
        return sum(v for k, v in self.stages.items() if k not in ("read", "write"))

    def ratio(self, peer: str) -> float | None:
        """Our time over that of a peer; too high where it was ended at its limit."""
        other = self.peers.get(peer)
        return None if other is None or other.seconds is None else self.seconds / other.seconds


def unwrap(path: Path, folder: Path) -> Run | None:
    """circparam in its own process; None where it failed."""
    faces = len(formats.read(path).mesh.faces)
    settings = {"path": str(path), "out": str(folder / f"{path.stem}.glb")}
    try:
        done = process.run("tests.bench.tasks:stages", {}, settings, LIMIT)
    except CircparamError as error:
        print(f"{path.name}: {error}", flush=True)
        return None
    if done.error is not None:
        print(f"{path.name}: {done.error}", flush=True)
        return None
    return Run(path.stem.split(".")[0], faces, done.info["stages"], done.info["figures"])


def beside(peer: str, path: Path, faces: int, folder: Path) -> Peer:
    """What a peer says that it took."""
    if faces >= UP_TO.get(peer, faces + 1):
        return Peer(None, "not run")
    limit = LIMITS[peer]
    try:
        done, _ = peer_process(peer, path, folder, limit)
    except subprocess.TimeoutExpired:
        return Peer(limit, "limit")
    if done.returncode != 0:
        return Peer(None, "failed")
    return Peer(float(json.loads(done.stdout.strip().splitlines()[-1])["seconds"]), "ended")


def profile(path: Path, folder: Path) -> list[tuple[str, float]]:
    """(function of this package, share of the time in it and in what it calls outside), highest first."""
    settings = {"path": str(path), "out": str(folder / f"{path.stem}.glb")}
    done = process.run("tests.bench.tasks:profile", {}, settings, 4 * LIMIT)
    if done.error is not None:
        raise SystemExit(f"{path.name}: {done.error}")
    return [(name, share) for name, share in done.info["shares"] if share >= SHOWN]


def verdicts(runs: list[Run]) -> list[Line]:
    """What is wanted of the set."""
    lines = []
    for peer, wanted in (("xatlas", 4.0), ("uvatlas", 0.12)):
        ratios = [r.ratio(peer) for r in runs if r.faces < LARGE]
        known = [x for x in ratios if x is not None]
        if known:
            ended = sum(r.peers[peer].how == "limit" for r in runs if r.faces < LARGE)
            name = f"below {LARGE} faces, time / {peer}'s, median"
            detail = f"{len(known)} of {len(ratios)} meshes, {ended} of them at the peer's limit"
            lines.append(Line(name, statistics.median(known), "", f"<= {wanted:g}", detail))
    small = [r for r in runs if r.faces < LARGE and r.ratio("xatlas") is not None]
    above = [r for r in small if r.seconds > allowed(r)]
    if small:
        name = f"below {LARGE} faces, meshes above 15 x xatlas' time and {FREE:g} s"
        lines.append(Line(name, len(above), "", "<= 0", f"of {len(small)}"))
    for r in above:
        lines.append(
            Line(f"{r.name}: seconds", r.seconds, "s", f"<= {allowed(r):.2f}", told(r, "xatlas"))
        )
    for r in runs:
        ratio = r.ratio("xatlas") if r.faces >= LARGE else None
        if ratio is not None and (r.name in WANTED or (r.peers["xatlas"].seconds or 0.0) > SLOW):
            name, want = f"{r.name}: time / xatlas'", WANTED.get(r.name, 1.0)
            lines.append(Line(name, ratio, "", f"<= {want:g}", told(r, "xatlas")))
        if r.name in MOST:
            lines.append(Line(f"{r.name}: seconds", r.seconds, "s", f"<= {MOST[r.name]:g}"))
    return lines


def allowed(run: Run) -> float:
    """Seconds that a small mesh may take beside what xatlas took."""
    return max(15 * (run.peers["xatlas"].seconds or 0.0), FREE)


def told(run: Run, peer: str) -> str:
    """The two times of a ratio."""
    return f"{run.seconds:.2f} s / {run.peers[peer].cell} s, {run.faces} faces"


def ends(runs: list[Run], names: list[str]) -> list[list[str]]:
    """How often each peer ended, a row a peer."""
    hows = ("ended", "limit", "failed", "not run")
    count = {n: [sum(r.peers[n].how == how for r in runs) for how in hows] for n in names}
    return [[n, f"{LIMITS[n]:g} s", *map(str, count[n])] for n in names]


def rows(runs: list[Run], names: list[str]) -> list[list[str]]:
    """A row a mesh."""
    out = []
    for r in sorted(runs, key=lambda r: r.faces):
        cells = []
        for name in names:
            ratio = r.ratio(name)
            sign = "< " if r.peers[name].how == "limit" else ""
            cells += [r.peers[name].cell, "–" if ratio is None else f"{sign}{ratio:.2f}"]
        stages = sorted(r.stages.items(), key=lambda kv: -kv[1])
        most = ", ".join(f"{k} {v:.2f}" for k, v in stages if v >= 5 * SHOWN * r.seconds)
        figures = [str(r.figures["charts"]), f"{r.figures['seam_length']:.2f}"]
        out.append([r.name, str(r.faces), f"{r.seconds:.2f}", *cells, *figures, most])
    return out


def main() -> None:
    """Run the set."""
    parser = argparse.ArgumentParser(description="How long whole atlases take beside peers.")
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--peers", default="xatlas,uvatlas")
    parser.add_argument("--profile", type=int, default=len(PROFILED), help="how many are profiled")
    parser.add_argument("--no-report", action="store_true")
    parser.add_argument("--report", type=Path, default=common.REPORTS, help="folder of speed.md")
    chosen = parser.parse_args()
    every = sorted(CORPUS.iterdir()) if CORPUS.is_dir() else []
    meshes = chosen.meshes or [p for p in every if p.suffix.lower() in SUFFIXES]
    if not meshes:
        parser.error("no meshes: name some, or set CIRCPARAM_CORPUS to a folder that has them")
    names = [n for n in chosen.peers.split(",") if PYTHONS.get(n)]
    start, load = time.monotonic(), _load()
    print("\n".join([*common.machine(), load]), flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # as installed: compiled once. In a checkout that must stay clean it would be compiled each time.
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        os.environ["PYTHONPYCACHEPREFIX"] = str(folder / "compiled")
        unwrap(samples.path("ribbon"), folder)
        runs = [run for path in meshes if (run := measured(path, names, folder)) is not None]
        picked = chosen.meshes or [p for p in meshes if p.name in PROFILED]
        hot = [[p.stem, hot_spots(p, folder)] for p in picked[: chosen.profile]]
    lines = verdicts(runs)
    for line in lines:
        say(line)
    failed = [p.name for p in meshes if p.stem.split(".")[0] not in {r.name for r in runs}]
    took = f"- the whole run took {(time.monotonic() - start) / 60:.1f} minutes"
    took += f"; no atlas of {', '.join(failed)}" if failed else ""
    print(took)
    if not chosen.no_report:
        blocks = report(runs, names, lines, hot)
        blocks = [[line for line in (load, took) if line], *blocks]
        print(f"written: {common.write('speed.md', TITLE, INTRO, blocks, chosen.report)}")


def _load() -> str:
    """What else went on when the run began: figures of a busy machine mean little."""
    return f"- load when it began: {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""


def measured(path: Path, names: list[str], folder: Path) -> Run | None:
    """One mesh, printed as soon as it is there."""
    run = unwrap(path, folder)
    if run is not None:
        run.peers = {peer: beside(peer, path, run.faces, folder) for peer in names}
        print(*rows([run], names)[0], sep="  ", flush=True)
    return run


def hot_spots(path: Path, folder: Path) -> str:
    """The functions that the processor was in most."""
    shares = ", ".join(f"{f} {100 * s:.0f} %" for f, s in profile(path, folder)[:12])
    print(f"{path.stem}: {shares}", flush=True)
    return shares


TITLE = "Speed of whole atlases"
INTRO = (
    "Made by `make bench-speed`: seconds of all stages without reading and writing, on all cores, beside "
    "the compute time that a peer tells of itself, in one run; imports are no part of either. A peer that did "
    "not end within its limit counts with the limit, so the ratio is an upper bound (`<`); one that failed "
    "counts nowhere. What the atlases of the peers are worth: [atlas.md](atlas.md). Hot spots: functions of "
    "this package in which a process without helpers spends its time, what they call outside the package "
    "included."
)


def report(
    runs: list[Run], names: list[str], lines: list[Line], hot: list[list[str]]
) -> list[list[str]]:
    """The blocks of the report."""
    head = ["mesh", "faces", "s", *[x for n in names for x in (f"{n} s", f"/ {n}")]]
    head += ["charts", "seam", "stages of 5 % and more, s"]
    peers = ["peer", "limit a mesh", "ended", "at its limit", "failed", "not run"]
    return [
        ["## Wanted and measured", "", *common.figures(lines)],
        ["## Peers", "", *common.table(peers, ends(runs, names))],
        ["## All meshes", "", *common.table(head, rows(runs, names))],
        ["## Hot spots", "", *common.table(["mesh", "functions"], hot)],
    ]


if __name__ == "__main__":
    main()
