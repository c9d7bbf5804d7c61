"""``make bench-noise``: what a change is worth, over many meshes and turns; writes docs/benchmarks/noise.md.

    python -m tests.bench noise [MESH...] [--base REV] [--set MODULE.NAME=VALUE] [--option NAME=VALUE]
                                [--turns 3] [--kind rotation|shuffle|jitter] [--bed FOLDER] [--most 60000]

The variant is the working tree, with the constants of --set and the options of --option; the base is a commit,
this one if none is named. Each mesh is unwrapped in several rotations (or orders of its faces, or with its
points a millionth of an edge away), which should change nothing: what they change is the noise that a
difference has to stand out of. Ratios are paired: the same mesh, turned the same way, by both builds. An
interval holds 90 % of the geometric means of 2,000 bootstrap samples of the meshes. Cost: that of the atlas
on its page (``AtlasCost``); seams and charts: its first two terms alone. Spread: the 90th over the 10th
percentile of the cost of one mesh over its turns. A surface is decided in a frame of its own, so rotations
measure that promise; the noise that a rule has to stand out of is sampled by jitter. Rows go to
FOLDER/rows.jsonl and are not computed twice, so a run that was ended goes on.
"""

import argparse
import ast
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from circparam.seams.cost import COST
from tests.bench import common
from tests.bench.bed import Bedded, bed, read

TASK = Path(__file__).with_name("noise_task.py")
FOLDER = common.ROOT / "build" / "noise"
LIMIT = 900.0  # seconds for all turns of one mesh
SAMPLES = 2_000  # of the bootstrap
MEASURED = ("seam_length", "seam_visible", "charts", "pack", "seconds")
FIGURES = ("cost", "seams_and_charts", *MEASURED)
# nobody sees a seam of a hundredth of the root of the area: ratios are those of figures with this added
LEAST = dict.fromkeys(FIGURES, 0.01) | dict.fromkeys(("charts", "pack", "seconds"), 0.0)

Tables = dict[str, dict[str, np.ndarray]]  # mesh → figure → (turns,)


@dataclass(frozen=True)
class Build:
    """One side of the comparison. tree: folder that holds the package; settings: of ``noise_task``."""

    tree: Path
    settings: dict[str, Any]

    @property
    def key(self) -> str:
        """The same for the same sources and settings, wherever they lie."""
        digest = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode())
        for path in sorted((self.tree / "circparam").rglob("*.py")):
            digest.update(str(path.relative_to(self.tree)).encode() + path.read_bytes())
        return digest.hexdigest()[:16]


class Rows:
    """What was measured: a figure by (build, mesh, kind, turn), kept in a file of lines of JSON."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, Lock()
        self._found: dict[tuple[str, str, str, int], dict[str, Any]] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        for line in path.read_text().splitlines() if path.exists() else ():
            self._keep(json.loads(line))

    def _keep(self, row: dict[str, Any]) -> None:
        self._found[row["build"], row["mesh"], row["kind"], row["turn"]] = row

    def get(self, build: str, mesh: str, kind: str, turn: int) -> dict[str, Any] | None:
        """A row, None where it was not measured."""
        return self._found.get((build, mesh, kind, turn))

    def add(self, row: dict[str, Any]) -> None:
        """Keep a row, on the disk as well."""
        with self._lock:
            self._keep(row)
            with self._path.open("a") as stream:
                stream.write(json.dumps(row) + "\n")


def git(*words: str, **rest: Any) -> subprocess.CompletedProcess[bytes]:
    """A command of git on this repository."""
    return subprocess.run(["git", *words], cwd=common.ROOT, capture_output=True, **rest)


def exported(revision: str, folder: Path) -> Path:
    """The package as it was at a commit, in a folder of its own."""
    named = git("rev-parse", f"{revision}^{{commit}}")
    if named.returncode:
        raise SystemExit(f"--base {revision}: git knows no such commit")
    tree = folder / named.stdout.decode().strip()[:12]
    if not tree.exists():
        tree.mkdir(parents=True)
        packed = git("archive", revision, "circparam", check=True).stdout
        subprocess.run(["tar", "x", "-C", str(tree)], input=packed, check=True)
    return tree


def measure(build: Build, mesh: Bedded, kind: str, turns: list[int], rows: Rows) -> str:
    """Add the rows of one mesh; "done", or why there are none."""
    key = build.key
    missing = [t for t in turns if rows.get(key, mesh.name, kind, t) is None]
    if not missing:
        return "done"
    points, faces = mesh.make()
    environment = os.environ | {"PYTHONPATH": str(build.tree), "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.npz"
        np.savez(path, points=points, faces=faces)
        words = [str(path), kind, json.dumps(build.settings), *map(str, missing)]
        try:
            done = subprocess.run(
                [sys.executable, str(TASK), *words], capture_output=True, text=True, timeout=LIMIT,
                env=environment, cwd=folder,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return f"not done after {LIMIT:g} s"
    for line in done.stdout.splitlines():
        rows.add({"build": key, "mesh": mesh.name, "kind": kind, **json.loads(line)})
    return done.stderr.strip().splitlines()[-1] if done.returncode else "done"


def table_of(rows: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    """Each figure of FIGURES, with LEAST added, over the turns of one mesh, (turns,)."""
    out = {k: np.array([r[k] for r in rows], float) for k in MEASURED}
    out["seam_visible"] = np.nan_to_num(out["seam_visible"])  # no seam, none that is seen
    out["seams_and_charts"] = out["seam_length"] + COST.chart * out["charts"]
    terms = ("seam_length", "charts", "distortion", "share_over_2", "pack")
    out["cost"] = np.array([COST.finished(*(r[k] or 0.0 for k in terms)) for r in rows])
    return {k: v + LEAST[k] for k, v in out.items()}


def interval(logs: np.ndarray) -> tuple[float, float, float]:
    """(geometric mean, its 5th and 95th percentile over bootstrap samples) of logarithms of ratios (n,)."""
    rng = np.random.default_rng(0)
    means = logs[rng.integers(0, len(logs), (SAMPLES, len(logs)))].mean(1)
    low, high = np.exp(np.quantile(means, [0.05, 0.95]))
    return float(np.exp(logs.mean())), float(low), float(high)


def compared(base: Tables, ours: Tables) -> list[list[str]]:
    """A row a figure: mean ratio with its interval, median, least and most of a mesh's mean ratio."""
    out, names = [], list(base)
    for figure in FIGURES:
        logs = np.array([np.log(ours[n][figure] / base[n][figure]).mean() for n in names])
        mean, low, high = interval(logs)
        cells = [f"{mean:.4f}", f"{low:.4f} to {high:.4f}", f"{np.exp(np.median(logs)):.4f}"]
        ends = [f"{np.exp(logs[k]):.3f} ({names[k]})" for k in (logs.argmin(), logs.argmax())]
        out.append([figure.replace("_", " "), *cells, *ends])
    return out


def spreads(tables: Tables) -> str:
    """The 90th over the 10th percentile of the cost over the turns, in words."""
    tenths = {name: np.quantile(t["cost"], [0.1, 0.9]) for name, t in tables.items()}
    each = {name: high / low for name, (low, high) in tenths.items()}
    worst = max(each, key=lambda name: each[name])
    median = np.median(list(each.values()))
    return f"{median:.3f} in the median, {each[worst]:.2f} at most ({worst})"


def bad(found: dict[str, list[dict[str, Any]]]) -> str:
    """Meshes whose atlas is not as promised in some turn."""
    wrong = lambda r: r["flips"] or r["overlap"] or r["status"] == "degraded"  # noqa: E731
    return ", ".join(sorted(n for n, rows in found.items() if any(map(wrong, rows)))) or "none"


def parse() -> argparse.Namespace:
    """The command line."""
    parser = common.options(__doc__)
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--base", default="HEAD", metavar="REV")
    parser.add_argument("--set", action="append", default=[], metavar="MODULE.NAME=VALUE")
    parser.add_argument("--option", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--kind", choices=("rotation", "shuffle", "jitter"), default="rotation")
    parser.add_argument("--bed", action="append", default=[], type=Path, metavar="FOLDER")
    parser.add_argument("--most", type=int, default=60_000, metavar="FACES")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--folder", type=Path, default=FOLDER)
    return parser.parse_args()


def assigned(texts: list[str]) -> dict[str, Any]:
    """NAME=VALUE pairs; values as Python writes them, else text."""
    out = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            out[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            out[name] = value
    return out


def main() -> None:
    """Measure what is missing, then compare."""
    chosen = parse()
    settings = {"constants": assigned(chosen.set), "options": assigned(chosen.option)}
    base = Build(exported(chosen.base, chosen.folder), {"constants": {}, "options": {}})
    builds = {"base": base, "variant": Build(common.ROOT, settings)}
    meshes = list(read(chosen.meshes)) if chosen.meshes else bed(chosen.bed, chosen.most)
    rows, turns = Rows(chosen.folder / "rows.jsonl"), list(range(chosen.turns))
    print("\n".join(common.machine()), f"{len(meshes)} meshes", sep="\n", flush=True)

    def one(task: tuple[Bedded, str]) -> None:
        mesh, name = task
        how = measure(builds[name], mesh, chosen.kind, turns, rows)
        print(f"{mesh.name} ({mesh.faces}), {name}: {how}", flush=True)

    asked = {build.key: name for name, build in builds.items()}  # the same build is measured once
    with ThreadPoolExecutor(chosen.jobs) as pool:
        list(pool.map(one, [(m, name) for m in meshes for name in asked.values()]))

    found: dict[str, dict[str, list[Any]]] = {}
    for name, build in builds.items():
        key, kind = build.key, chosen.kind
        every = {m.name: [rows.get(key, m.name, kind, t) for t in turns] for m in meshes}
        found[name] = {mesh: some for mesh, some in every.items() if all(some)}
    both = [m for m in found["base"] if m in found["variant"]]
    if not both:
        raise SystemExit("no mesh was unwrapped by both builds")
    tables = {name: {m: table_of(found[name][m]) for m in both} for name in builds}
    head = (
        "variant / base",
        "mean",
        "90 % interval",
        "median",
        "least of a mesh",
        "most of a mesh",
    )
    facts = [
        f"- {len(both)} meshes of {len(meshes)}, {len(turns)} turns each ({chosen.kind})",
        f"- base: {chosen.base}; variant: {json.dumps(settings)}",
        *(f"- spread of the {n}: {spreads(tables[n])}" for n in builds),
        *(f"- {n}, flipped, overlapping or degraded: {bad(found[n])}" for n in builds),
    ]
    report = common.table(head, compared(tables["base"], tables["variant"]))
    print("\n".join([*facts, *report]))
    if not chosen.no_report:
        intro = "Made by `make bench-noise`; see the head of `tests/bench/noise.py`."
        title = "A change beside the noise"
        common.write("noise.md", title, intro, [facts, report])
