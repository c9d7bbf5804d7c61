"""One mesh by circparam and by other unwrappers, each in a process of its own, and figures of what they wrote.

Figures come from the written files. They are read by an independent judge where one is named (--judge or
CIRCPARAM_JUDGE: a script that prints one JSON document for a file, with the names of ``JUDGED``), else by
circparam's own verification. Peers run under the Python that has them: this one for xatlas and uvunwrap,
CIRCPARAM_OPEN3D_PYTHON for uvatlas, CIRCPARAM_BPY_PYTHON for blender.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from circparam import formats
from circparam.core import own_process
from circparam.errors import CircparamError
from circparam.mesh.repair import repair
from circparam.pipeline.verify import verify
from tests.bench import common
from tests.bench.common import Line
from tests.support.corpus import CORPUS
from tests.support.writers import obj

PYTHONS = {
    "xatlas": sys.executable,
    "uvatlas": os.environ.get("CIRCPARAM_OPEN3D_PYTHON", ""),
    "blender": os.environ.get("CIRCPARAM_BPY_PYTHON", ""),
    "uvunwrap": sys.executable if importlib.util.find_spec("uvunwrap") else "",
}
# figures of a judge → circparam's own names for them
JUDGED = {
    "charts": "charts", "seam_length": "seam_length", "sd": "distortion",
    "sd_chart_max": "distortion_max_chart", "flips": "flips", "mirrored_charts": "mirrored",
    "overlap": "overlap", "pack": "pack",
}  # fmt: skip
BOUND = 1.05  # the default of --max-distortion
ABSURD = 2.0  # of SD/4: a collapsed face makes the figure a number without meaning


@dataclass
class Atlas:
    """One atlas. path: the file, None where there is none, with why. seconds: without reading and writing."""

    who: str
    path: Path | None = None
    judge: Path | None = None
    seconds: float = 0.0
    peak: float | None = None
    bound: float | None = None
    status: str = ""
    stages: dict[str, float] = field(default_factory=dict)
    why: str = ""

    @property
    def ok(self) -> bool:
        """Whether there are figures."""
        return self.path is not None

    @cached_property
    def figures(self) -> dict[str, Any]:
        """Those of JUDGED, and in_unit_square."""
        assert self.path is not None
        return judged(self.path, self.judge)

    def clean(self) -> bool:
        """No flip, no mirrored chart, no overlap, all inside the unit square."""
        zero = all(not self.figures[k] for k in ("flips", "mirrored_charts", "overlap"))
        return zero and bool(self.figures["in_unit_square"])

    def cells(self, *texts: str) -> list[str]:
        """Format strings with the figures and seconds filled in."""
        if not self.ok:
            return [f"failed: {self.why}".replace("|", "/"), *[""] * (len(texts) - 1)]
        return [text.format(**self.figures, seconds=self.seconds) for text in texts]


@dataclass(frozen=True)
class Bench:
    """Where files go, who judges them, and the seconds that each unwrapper has for a mesh."""

    folder: Path
    judge: Path | None = None
    limit: float = 600.0

    def unwrap(self, path: Path, bound: float | None = None, effort: float | None = None) -> Atlas:
        """circparam with its defaults, or with a bound or an effort."""
        out = self.folder / f"{path.stem}-{bound}-{effort}.obj"
        given = {"max_distortion": bound, "effort": effort}
        settings = {"path": str(path), "out": str(out), "options": given}
        try:
            done = own_process.run("tests.bench.tasks:unwrap", {}, settings, self.limit)
        except CircparamError as error:
            return Atlas("circparam", bound=bound, why=str(error))
        if done.error is not None:
            return Atlas("circparam", bound=bound, why=done.error)
        stages = done.info["stages"]
        seconds = sum(v for k, v in stages.items() if k not in ("read", "write"))
        peak = None if done.peak_bytes is None else done.peak_bytes / 2**30
        status = done.info["status"]
        return Atlas("circparam", out, self.judge, seconds, peak, bound, status, stages)

    def peer(self, name: str, path: Path, limit: float | None = None) -> Atlas:
        """A peer on the welded mesh of a file; status: ended, limit or failed."""
        mesh = formats.read(path).mesh
        faces = mesh.weld[mesh.faces]
        faces = faces[(faces != np.roll(faces, 1, 1)).all(1)]
        used, index = np.unique(faces, return_inverse=True)
        given = {"points": mesh.points[used], "faces": index.reshape(-1, 3)}
        limit = limit or self.limit
        try:
            found, said = run_peer(name, PYTHONS[name], given, self.folder, limit)
        except subprocess.TimeoutExpired:
            return Atlas(name, seconds=limit, status="limit", why=f"more than {limit:g} s")
        except RuntimeError as error:
            return Atlas(name, status="failed", why=str(error)[:80])
        out = self.folder / f"{path.stem}-{name}.obj"
        out.write_bytes(obj(*(found[k] for k in ("points", "faces", "uv", "uv_faces"))))
        return Atlas(name, out, self.judge, said["seconds"], status="ended")

    def beside(self, peer: Atlas, path: Path) -> Atlas:
        """circparam at the distortion that a peer reached, or at the strictest bound."""
        sane = peer.ok and peer.figures["sd"] < ABSURD
        return self.unwrap(path, max(1.01, peer.figures["sd"]) if sane else 1.01)


def run_peer(
    name: str, python: str, given: dict[str, Any], folder: Path, limit: float
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """(arrays, what it says) of a row of ``tests/bench/peers.py`` under a Python that has it.

    Raises subprocess.TimeoutExpired after ``limit`` seconds, RuntimeError with its last words if it died.
    """
    source, target = (folder / f"{name}.{s}.npz" for s in ("in", "out"))
    target.unlink(missing_ok=True)
    np.savez(source, **given)
    command = [python, str(Path(__file__).with_name("peers.py")), name, str(source), str(target)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
    if done.returncode != 0 or not target.exists():
        raise RuntimeError((done.stderr.strip().splitlines() or ["it died"])[-1])
    with np.load(target) as out:
        return dict(out), json.loads(done.stdout.strip().splitlines()[-1])


def judged(path: Path, judge: Path | None) -> dict[str, Any]:
    """Figures of a written file."""
    if judge is not None:
        command = [sys.executable, str(judge), str(path)]
        said = json.loads(
            subprocess.run(command, capture_output=True, text=True, check=True).stdout
        )
        if "error" in said:
            raise SystemExit(f"the judge on {path}: {said['error']}")
        return {k: said[k] for k in (*JUDGED, "in_unit_square")}
    document = formats.read(path)
    uvmap = document.uv()
    if uvmap is None:
        raise SystemExit(f"{path} has no uv")
    found = verify(repair(document.mesh)[0], uvmap, resolution=2048)
    inside = bool((found.uv_min >= -1e-6).all() and (found.uv_max <= 1 + 1e-6).all())
    numbers = found.numbers()
    return {k: numbers[own] for k, own in JUDGED.items()} | {"in_unit_square": inside}


def ratios(pairs: Iterable[tuple[Atlas, Atlas]], key: str) -> list[float]:
    """A figure, or the seconds, of the first over those of the second, where both have it."""
    out = []
    for a, b in pairs:
        if key == "seconds":
            out.append(a.seconds / max(b.seconds, 1e-3))
        elif a.ok and b.ok and b.figures[key] > 0:
            out.append(a.figures[key] / b.figures[key])
    return out


def arguments(text: str | None, peers: str) -> argparse.ArgumentParser:
    """The command line of a benchmark of whole atlases. peers: those that it runs if none is named."""
    parser = common.options(text)
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH", help="instead of the set")
    judge = os.environ.get("CIRCPARAM_JUDGE") or None
    parser.add_argument("--judge", type=Path, default=judge, help="a script that reads the files")
    there = ",".join(n for n in peers.split(",") if PYTHONS[n])
    parser.add_argument("--peers", default=there, help=f"of: {', '.join(PYTHONS)}")
    return parser


def parsed(
    parser: argparse.ArgumentParser,
    chosen: argparse.Namespace,
    names: Iterable[str],
    made: bool = False,
) -> tuple[list[Path], list[str]]:
    """(the meshes of a command line, or those of these names that the corpus has; its peers).

    made: the benchmark makes meshes of its own, so there may be none of the corpus.
    """
    meshes = chosen.meshes or [CORPUS / n for n in names if (CORPUS / n).exists()]
    if not meshes and not made:
        parser.error("no meshes: name some, or set CIRCPARAM_CORPUS to a folder that has them")
    peers = [n for n in chosen.peers.split(",") if n]
    for name in peers:
        if not PYTHONS.get(name):
            parser.error(f"no Python for peer {name!r}: see the head of tests/bench/atlases.py")
    print("\n".join(common.machine()), flush=True)
    return meshes, peers


def line_of(name: str, found: list[float], which: str, wanted: str) -> Line:
    """The median or the worst of some ratios, as a figure."""
    value = float(np.median(found)) if which == "median" else max(found)
    return Line(f"{name}, {which}", value, "", wanted, f"{len(found)} meshes")
