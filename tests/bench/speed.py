"""``make bench-speed``: how long whole atlases take beside peers in one run; writes docs/benchmarks/speed.md.

    python -m tests.bench.speed [MESH...] [--peers xatlas,uvatlas] [--profile N]

Meshes: files, or all of the corpus folder (CIRCPARAM_CORPUS) when none is given. Compared are the stages
without reading and writing with the compute time that a peer tells of itself, each in a process of its own.
The profile (of a fixed set, or of the meshes named) tells which functions of this package the processor was in,
worker processes left out. Peers run under the Python that has them, as in ``atlas``.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from circparam import formats
from circparam.compare import process
from circparam.errors import CircparamError
from tests.bench import common
from tests.bench.atlas import PYTHONS
from tests.bench.common import Line, say
from tests.support.corpus import CORPUS

SUFFIXES = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf")
PROFILED = (
    "spot.obj", "cow.obj", "fandisk.obj", "rocker-arm.obj", "boot.obj", "ogre.obj", "beast.obj",
    "stanford-bunny.obj", "armadillo.obj", "CesiumMan.glb", "teapot.obj", "bunny_1hole.obj", "fuze.obj",
    "woody.obj",
)  # fmt: skip
# what stages took before the work on small meshes
BEFORE = Path(__file__).with_name("speed_before.json")
GROUPS = {
    "charts": ("charts", "seams"), "carry": ("carry",), "relax": ("relax", "flatten"), "enforce": ("enforce",),
    "stretch": ("stretch",), "visibility": ("visibility",), "pack": ("pack",),
    "check": ("repair", "check", "verify"),
}  # fmt: skip
LARGE = 20_000  # faces from which on other things are wanted
SLOW = 2.0  # seconds of xatlas: from there on, on large meshes, it is never to be faster
FREE = 0.6  # seconds that no ratio is taken of
WANTED = {"stanford-bunny": 0.2, "armadillo": 0.5, "ogre": 1.0, "boot": 1.0}
LIMIT = 600.0
# a stage is shown where it takes this share of the whole, and a function where it does
SHOWN = 0.01


@dataclass
class Run:
    """One mesh: stages in seconds, what the atlas is, the seconds of each peer (None: it failed)."""

    name: str
    faces: int
    stages: dict[str, float]
    figures: dict[str, Any]
    peers: dict[str, float | None] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """All stages but reading and writing."""
        return sum(v for k, v in self.stages.items() if k not in ("read", "write"))

    def ratio(self, peer: str) -> float | None:
        """Our time over that of a peer."""
        other = self.peers.get(peer)
        return None if other is None else self.seconds / other


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


def peer_seconds(peer: str, path: Path, folder: Path) -> float | None:
    """What a peer says that it took; None where it failed."""
    mesh = formats.read(path).mesh
    faces = mesh.weld[mesh.faces]
    faces = faces[(faces != np.roll(faces, 1, 1)).all(1)]
    used, index = np.unique(faces, return_inverse=True)
    source, target = folder / "in.npz", folder / "out.npz"
    np.savez(source, points=mesh.points[used], faces=index.reshape(-1, 3))
    script = Path(__file__).with_name("peers.py")
    command = [PYTHONS[peer], str(script), peer, str(source), str(target)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False)
    except subprocess.TimeoutExpired:
        return None
    if done.returncode != 0:
        return None
    return float(json.loads(done.stdout.strip().splitlines()[-1])["seconds"])


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
        small = [r for r in runs if r.faces < LARGE and r.ratio(peer) is not None]
        if small:
            ratios = [r.ratio(peer) or 0.0 for r in small]
            name = f"below {LARGE} faces, time / {peer}'s, median"
            detail = f"{len(small)} meshes"
            lines.append(Line(name, statistics.median(ratios), "", f"<= {wanted:g}", detail))
    for r in runs:
        other = r.peers.get("xatlas")
        if other is None:
            continue
        detail = f"{r.seconds:.2f} s / {other:.2f} s, {r.faces} faces"
        if r.faces < LARGE:
            limit = max(15 * other, FREE)
            if r.seconds > limit:
                lines.append(Line(f"{r.name}: seconds", r.seconds, "s", f"<= {limit:.2f}", detail))
        elif other > SLOW or r.name in WANTED:
            want = WANTED.get(r.name, 1.0)
            lines.append(
                Line(f"{r.name}: time / xatlas'", r.seconds / other, "", f"<= {want:g}", detail)
            )
    return lines


def rows(runs: list[Run], names: list[str]) -> list[list[str]]:
    """A row a mesh."""
    out = []
    for r in sorted(runs, key=lambda r: r.faces):
        beside = []
        for name in names:
            other, ratio = r.peers.get(name), r.ratio(name)
            beside += (
                ["–", "–"] if other is None or ratio is None else [f"{other:.2f}", f"{ratio:.2f}"]
            )
        stages = sorted(r.stages.items(), key=lambda kv: -kv[1])
        told = ", ".join(f"{k} {v:.2f}" for k, v in stages if v >= 5 * SHOWN * r.seconds)
        figures = [str(r.figures["charts"]), f"{r.figures['seam_length']:.2f}"]
        out.append([r.name, str(r.faces), f"{r.seconds:.2f}", *beside, *figures, told])
    return out


def by_stage(runs: list[Run], earlier: dict[str, Any]) -> list[list[str]]:
    """Two rows a mesh that was measured before: seconds of groups of stages then and now, charts and seam."""

    def row(name: str, which: str, stages: dict[str, float], figures: dict[str, Any]) -> list[str]:
        own = {k: v for k, v in stages.items() if k not in ("read", "write")}
        groups = {k: sum(own.pop(s, 0.0) for s in some) for k, some in GROUPS.items()}
        total = sum(groups.values()) + sum(own.values())
        cells = [f"{x:.2f}" for x in (total, *groups.values(), sum(own.values()))]
        return [name, which, *cells, str(figures["charts"]), f"{figures['seam_length']:.2f}"]

    out = []
    for r in sorted(runs, key=lambda r: r.faces):
        was = earlier.get(r.name)
        if was is not None:
            out.append(row(r.name, "before", was["stages"], was))
            out.append(row("", "now", r.stages, r.figures))
    return out


def main() -> None:
    """Run the set."""
    parser = argparse.ArgumentParser(description="How long whole atlases take beside peers.")
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--peers", default="xatlas,uvatlas")
    parser.add_argument("--profile", type=int, default=len(PROFILED), help="how many are profiled")
    parser.add_argument("--no-report", action="store_true")
    chosen = parser.parse_args()
    every = sorted(CORPUS.iterdir()) if CORPUS.is_dir() else []
    meshes = chosen.meshes or [p for p in every if p.suffix.lower() in SUFFIXES]
    if not meshes:
        parser.error("no meshes: name some, or set CIRCPARAM_CORPUS to a folder that has them")
    names = [n for n in chosen.peers.split(",") if PYTHONS.get(n)]
    print("\n".join(common.machine()), flush=True)
    runs, hot = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in meshes:
            run = unwrap(path, folder)
            if run is None:
                continue
            run.peers = {peer: peer_seconds(peer, path, folder) for peer in names}
            runs.append(run)
            print(*rows([run], names)[0], sep="  ", flush=True)
        wanted = chosen.meshes or [p for p in meshes if p.name in PROFILED]
        for path in wanted[: chosen.profile]:
            shares = ", ".join(f"{f} {100 * s:.0f} %" for f, s in profile(path, folder)[:12])
            hot.append([path.stem, shares])
            print(*hot[-1], sep=": ", flush=True)
    lines = verdicts(runs)
    for line in lines:
        say(line)
    if not chosen.no_report:
        print(f"written: {report(runs, names, lines, hot)}")


def report(runs: list[Run], names: list[str], lines: list[Line], hot: list[list[str]]) -> Path:
    """The whole as Markdown."""
    head = ["mesh", "faces", "s", *[x for n in names for x in (f"{n} s", f"/ {n}")]]
    head += ["charts", "seam", "stages of 5 % and more, s"]
    intro = (
        "Made by `make bench-speed`: seconds of all stages without reading and writing, beside the compute "
        "time that a peer tells of itself, in one run. Hot spots: functions of this package in which a process "
        "without helpers spends its time, what they call outside the package included."
    )
    earlier = json.loads(BEFORE.read_text(encoding="utf-8"))
    stages = ["mesh", "", "s", *GROUPS, "other", "charts", "seam"]
    blocks = [
        ["## Wanted and measured", "", *common.figures(lines)],
        ["## All meshes", "", *common.table(head, rows(runs, names))],
        [
            "## Before and now, by stage",
            "",
            f"Seconds of wall time. Before: {earlier['what']}.",
            "",
            *common.table(stages, by_stage(runs, earlier["meshes"])),
        ],
        ["## Hot spots", "", *common.table(["mesh", "functions"], hot)],
    ]
    return common.write("speed.md", "Speed of whole atlases", intro, blocks)


if __name__ == "__main__":
    main()
