"""``make bench-scale``: rough meshes with floaters and an inner shell; docs/benchmarks/scale.md.

    python -m tests.bench scale [--sizes 0.09,0.33,0.66,1.2,4.7,10] [--floaters 20000] [--holes 20000]

Every mesh is made here: a ball with limbs, displaced by waves and by noise of a quarter of an edge, an inner
shell and 40 floaters, some of them open. Each is unwrapped to PLY by the command line in a process of its own;
figures are those of its JSON; processor seconds are those of its workers too, peak memory is its own.
--floaters adds a body among so many floaters, --holes a sheet with so many holes, each beside its clean twin.
4.7 and 10 million faces take minutes and 7 and 17 GB.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.bench import common
from tests.bench.common import Line
from tests.support import shapes
from tests.support.writers import ply_binary

SIZES = (0.09, 0.33, 0.66, 1.2)  # million faces
ASKED = {0.33: 15.0, 0.66: 30.0, 1.2: 60.0, 4.7: 300.0, 10.0: 720.0}  # seconds on two quiet cores
MEMORY = {1.2: 4.0, 4.7: 10.0, 10.0: 18.0}  # GB
LIMBS, WAVES, FLOATERS = 9, 24, 40
FINE = 0.25  # of an edge: the noise of a scanner
TWIN = 1.5  # times the seconds a face of the clean twin that floaters may take


@dataclass(frozen=True)
class Run:
    """One mesh: the JSON of the command, wall and processor seconds, GB at the highest point."""

    name: str
    told: dict[str, Any]
    wall: float
    processor: float
    memory: float


def ball(side: int) -> shapes.Shape:
    """A closed ball of 12 · side² triangles: the six sides of a cube, side × side squares each, blown up."""
    t = np.tan(np.linspace(-np.pi / 4, np.pi / 4, side + 1))
    u, v = (a.ravel() for a in np.meshgrid(t, t, indexing="ij"))
    one = np.ones_like(u)
    sheets = [
        np.stack(np.roll([u * s, v, one * s], k, 0), 1) for k in range(3) for s in (1.0, -1.0)
    ]
    square = squares(*np.divmod(np.arange(side**2), side), side)
    points = np.concatenate(sheets)
    faces = np.concatenate([square + k * len(u) for k in range(6)])
    grid = np.rint(points * 1e6).astype(np.int64)
    _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    points = points[first]
    return points / np.linalg.norm(points, axis=1)[:, None], inverse.reshape(-1)[faces]


def squares(i: np.ndarray, j: np.ndarray, n: int) -> np.ndarray:
    """Two triangles for each of some squares (i, j) of a grid of n × n, first those below the diagonals."""
    a = i * (n + 1) + j
    b, c, d = a + n + 1, a + n + 2, a + 1
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def scan(count: int, seed: int, floaters: int = FLOATERS) -> shapes.Shape:
    """A mesh of about so many faces as scanners and generators make them."""
    rng = np.random.default_rng(seed)
    points, faces = ball(max(int(np.sqrt(count / 12 * 0.9)), 8))
    centre = rng.normal(size=(LIMBS, 3))
    centre /= np.linalg.norm(centre, axis=1)[:, None]
    radius = np.ones(len(points))
    for middle, length, width in zip(
        centre, rng.uniform(0.3, 1.0, LIMBS), rng.uniform(6, 25, LIMBS), strict=True
    ):
        radius += length * np.exp(width * (points @ middle - 1))
    for wave, phase in zip(rng.normal(size=(WAVES, 3)) * 7, rng.uniform(0, 7, WAVES), strict=True):
        radius += 0.012 * np.sin(points @ wave + phase)
    body = points * radius[:, None]
    edge = float(np.linalg.norm(body[faces[:, 0]] - body[faces[:, 1]], axis=1).mean())
    body += FINE * edge * rng.standard_normal(body.shape)
    shell = ball(max(int(np.sqrt(count / 12 * 0.1)), 4))
    parts = [(body, faces), (shell[0] * 0.8, shell[1][:, ::-1])]
    kinds = [shapes.icosphere(1), shapes.icosphere(0), shapes.hemisphere(3), ball(2)]
    for k in range(floaters):
        p, f = kinds[k % len(kinds)]
        way = rng.normal(size=3)
        place = way / np.linalg.norm(way) * rng.uniform(2.2, 3.0)
        parts.append((p * rng.uniform(0.008, 0.02) + place, f))
    return shapes.join(*parts)


def sheet(holes: int, side: int = 0) -> shapes.Shape:
    """A wavy sheet with so many holes of one or four squares; side: squares on a side, where they are told."""
    across = int(np.ceil(np.sqrt(holes)))
    n = side or 4 * across + 1
    x, y = (a.ravel() for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    z = 0.1 * n * np.sin(8 * x / n) * np.cos(6 * y / n)
    i, j = np.divmod(np.arange(n**2), n)
    number = (i // 4) * across + j // 4
    width = 1 + number % 2  # of the hole in each block of 4 × 4
    inside = (i % 4 > 0) & (i % 4 <= width) & (j % 4 > 0) & (j % 4 <= width)
    keep = ~(inside & (number < holes) & (i // 4 < across) & (j // 4 < across))
    return shapes.compact(np.stack([x, y, z], 1) / n, squares(i[keep], j[keep], n))


def unwrap(name: str, shape: shapes.Shape, folder: Path) -> Run:
    """The command line on one mesh in float32, as scanners write it."""
    source, target = folder / "in.ply", folder / "out.ply"
    source.write_bytes(ply_binary(shape[0].astype(np.float32), shape[1]))
    command = [sys.executable, "-m", "circparam", "unwrap", str(source), "-o", str(target)]
    start, before = time.perf_counter(), common.children_seconds()
    process = subprocess.Popen([*command, "--overwrite", "--json"], stdout=subprocess.PIPE)
    text = process.stdout.read() if process.stdout else b""
    _, code, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(code)
    wall = time.perf_counter() - start
    if process.returncode not in (0, 6):
        raise SystemExit(f"{name}: circparam ended with code {process.returncode}")
    processor = common.children_seconds() - before
    return Run(name, json.loads(text), wall, processor, usage.ru_maxrss / 2**20)


def row(run: Run) -> list[str]:
    """The cells of one mesh."""
    t = run.told
    stages = sorted(t["stages"].items(), key=lambda x: -x[1])[:5]
    return [
        run.name, f"{t['faces']:,}", f"{run.wall:.1f}", f"{run.processor:.1f}",
        f"{run.processor / t['faces'] * 1e6:.0f}", f"{run.memory:.2f}", str(t["charts"]),
        f"{t['seam_length']:.2f}", f"{t['distortion']:.4f}",
        f"{t['flips']} / {t['mirrored']} / {t['overlap']:g}",
        ", ".join(f"{name} {seconds:.1f}" for name, seconds in stages),
    ]  # fmt: skip


HEAD = (
    "mesh", "faces", "seconds", "processor s", "µs a face", "GB", "charts", "seam", "SD",
    "flips / mirrored / overlap", "longest stages",
)  # fmt: skip


def lines_of(size: float, run: Run) -> list[Line]:
    """The figures that something is asked of."""
    goals = [f"<= {goal[size]:g}" if size in goal else None for goal in (ASKED, MEMORY)]
    name = f"{size:g}M faces"
    return [Line(name, run.wall, "s", goals[0]), Line(name, run.memory, "GB", goals[1])]


def beside_twin(name: str, many: Run, twin: Run) -> Line:
    """The time of a face of a mesh over that of a face of its clean twin."""
    share = many.processor / many.told["faces"] * twin.told["faces"] / twin.processor
    return Line(f"{name}, a face, over the clean twin", share, "", f"<= {TWIN:g}")


def main() -> None:
    """Make the meshes, unwrap them, write the report."""
    parser = common.options(__doc__)
    parser.add_argument("--sizes", default=",".join(f"{s:g}" for s in SIZES), help="million faces")
    parser.add_argument("--floaters", type=int, default=0, help="of another mesh, with its twin")
    parser.add_argument("--holes", type=int, default=0, help="of a sheet, with its twin")
    given = parser.parse_args()
    runs: list[Run] = []
    lines: list[Line] = []
    with tempfile.TemporaryDirectory(prefix="circparam-") as name:

        def told(what: str, shape: shapes.Shape) -> Run:
            """The command line on one more mesh."""
            runs.append(unwrap(what, shape, Path(name)))
            print(*row(runs[-1]), sep="  ", flush=True)
            return runs[-1]

        for size in (float(s) for s in given.sizes.split(",") if s):
            lines += lines_of(size, told(f"{size:g}M", scan(int(size * 1e6), 1)))
        if given.floaters:
            many = told("floaters", scan(20_000, 1, given.floaters))
            twin = told("twin", scan(many.told["faces"], 1, 0))
            lines.append(beside_twin(f"{given.floaters} floaters", many, twin))
        if given.holes:
            many = told("holes", sheet(given.holes))
            twin = told("sheet", sheet(0, int(np.sqrt(many.told["faces"] / 2))))
            lines.append(beside_twin(f"{given.holes} holes", many, twin))
    blocks = [common.table(HEAD, map(row, runs)), common.wanted(lines)]
    if not given.no_report:
        intro = "Made by `make bench-scale`, by tests/bench/scale.py."
        common.write("scale.md", "Large meshes", intro, blocks)
