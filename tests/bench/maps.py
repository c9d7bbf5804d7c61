"""``make bench-maps``: maps between pairs of surfaces; writes docs/benchmarks/maps.md.

    python -m tests.bench maps [PAIR ...] [--no-report] [--no-speed]

Pairs out of the project's own scripts, four of them with handles. Where a surface meets its own remeshing (with
noise or without), the place of every vertex is known: the error is the distance from there, in sizes (diagonals
of the box). The weights are compared by the distortion of the composed convex maps, before relaxation.
"""

import resource
import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

import circparam
from circparam.maps.map_surfaces import MapResult
from circparam.mesh.mesh import Mesh
from tests.bench import common
from tests.bench.common import ROOT, Line
from tests.support import pairs, shapes, tori

OVERLAID = ("blob, its remeshing", "creature and its pose", "torus, its remeshing", "two tori")
METHODS = ("circle", "mean-value", "floater", "uniform")
# tail, snout, feet and ears of the creature of data/implicit.py
TIPS = np.array(
    [
        [-2.0, 0, 0.53], [1.87, 0, 1.33], [-0.8, 0.42, -0.13], [-0.8, -0.42, -0.13],
        [0.55, 0.4, -0.12], [0.55, -0.4, -0.12], [0.98, 0.38, 2.1], [0.98, -0.38, 2.1],
    ]
)  # fmt: skip
ON_DISK = np.array(
    [
        [1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0],
        [0.5, 0.2, 0], [-0.4, 0.4, 0], [-0.3, -0.5, 0], [0.4, -0.5, 0],
    ]
)  # fmt: skip


@dataclass
class Pair:
    """Two surfaces, their landmarks, and where the vertices of the first belong, where that is known."""

    name: str
    a: Mesh
    b: Mesh
    marks: np.ndarray
    truth: np.ndarray | None = None


def creature(step: float, shift: float = 0.0) -> Mesh:
    """The creature of the samples at any resolution; shift moves the grid that it is sampled on."""
    sys.path.insert(0, str(ROOT / "data"))
    from implicit import creature_field, marching_tetrahedra, relaxed

    low = np.array([-2.15, -0.8, -0.3]) - shift * step
    axes = [np.arange(a, b + step, step) for a, b in zip(low, (2.1, 0.8, 2.3), strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    p, f = marching_tetrahedra(creature_field(grid), low, step)
    return Mesh(*shapes.compact(relaxed(p, f), f))


def posed(p: np.ndarray) -> np.ndarray:
    """The creature with its head turned and its legs moved."""
    q = p.copy()
    turn = np.clip((p[:, 0] - 0.5) / 0.8, 0, 1)
    turn = turn * turn * (3 - 2 * turn) * 0.7
    x, y = p[:, 0] - 0.5, p[:, 1]
    q[:, 0] = 0.5 + np.cos(turn) * x - np.sin(turn) * y
    q[:, 1] = np.sin(turn) * x + np.cos(turn) * y
    low = np.clip((0.6 - p[:, 2]) / 0.6, 0, 1) ** 2
    q[:, 0] += 0.35 * low * np.sign(p[:, 1]) * np.clip(np.abs(p[:, 1]) / 0.2, 0, 1)
    return q


def noisy(mesh: Mesh, amount: float = 0.001) -> Mesh:
    """With normal noise, in sizes."""
    shake = np.random.default_rng(0).normal(size=mesh.points.shape) * amount * size_of(mesh)
    return Mesh(mesh.points + shake, mesh.faces)


def nearest_marks(a: Mesh, b: Mesh, points: np.ndarray) -> np.ndarray:
    """(k, 2) the vertices nearest to some places on both."""
    return np.stack([pairs.nearest(m, points) for m in (a, b)], 1)


def disk(n: int, seed: int, height: float = 0.6) -> Mesh:
    """A bumpy round sheet."""
    return Mesh(*shapes.bumped_disk(n, height=height, seed=seed))


def on_sheet(a: Mesh, b: Mesh) -> np.ndarray:
    """(k, 2) vertices of two round sheets, alike from above."""
    flat = [Mesh(m.points * [1, 1, 0], m.faces) for m in (a, b)]
    return nearest_marks(flat[0], flat[1], ON_DISK)


def ring(around: int, along: int, height: float) -> Mesh:
    """A waved ring."""
    return Mesh(*shapes.waved(shapes.annulus(around, along), height))


def with_handles() -> list[Pair]:
    """Four pairs of genus 1 and 2, three of them with a known answer."""
    ring, again = tori.torus(80, 36, 0.3), tori.torus(104, 52, 0.3)
    other = tori.torus(72, 40, 0.1)
    plate, fine = tori.plate(5), tori.plate(5, fine=True)
    own = tori.spread(plate, 20)
    marks = np.stack([own, pairs.nearest(fine, plate.points[own])], 1)
    return [
        Pair("torus, its remeshing", ring, again, tori.marks(ring, again, 8, 4), ring.points),
        Pair("two tori", ring, other, tori.marks(ring, other, 8, 4)),
        Pair("genus 2, in finer triangles", plate, fine, marks, plate.points),
        Pair("genus 2, finer with noise", plate, noisy(fine), marks, plate.points),
    ]


def all_pairs() -> list[Pair]:
    """Fourteen pairs: nine with a known answer, a pose, and four of unlike shapes."""
    ball, turned = pairs.blob(4, 1), pairs.blob(4, 1, turned=5)
    marks = pairs.marks(ball, turned)
    other, coarse = pairs.blob(4, 6, turned=3), pairs.blob(3, 1, turned=2)
    a, b = creature(0.115), creature(0.1, 0.37)
    tips = nearest_marks(a, b, TIPS)
    sheet, again = disk(2500, 0), disk(3500, 3)
    flat = disk(3000, 5, height=0.15)
    first, second = ring(64, 14, 0.1), ring(56, 12, 0.25)
    rings = nearest_marks(first, second, first.points[[0, 10, 30]])
    return [
        Pair("blob, its remeshing", ball, turned, marks, ball.points),
        Pair("blob, remeshed with noise", ball, noisy(turned), marks, ball.points),
        Pair("blob, coarse and dense", coarse, ball, pairs.marks(coarse, ball), coarse.points),
        Pair("creature, its remeshing", a, b, tips, a.points),
        Pair("creature, remeshed with noise", a, noisy(b), tips, a.points),
        Pair("sheet, its remeshing", sheet, again, on_sheet(sheet, again), sheet.points),
        Pair("creature and its pose", a, Mesh(posed(b.points), b.faces), tips),
        Pair("two blobs", ball, other, pairs.marks(ball, other)),
        Pair("two sheets", sheet, flat, on_sheet(sheet, flat)),
        Pair("two rings", first, second, rings[:1]),
        *with_handles(),
    ]


def size_of(mesh: Mesh) -> float:
    """Diagonal of the box."""
    return float(np.linalg.norm(np.ptp(mesh.points, axis=0)))


def mapped(pair: Pair, **options: Any) -> tuple[MapResult, float]:
    """The map of a pair, and the processor seconds of this process."""
    start = time.process_time()
    found = circparam.map_surfaces(pair.a, pair.b, landmarks=pair.marks, **options)
    return found, time.process_time() - start


def moved_back(pair: Pair, found: MapResult) -> float:
    """How far A → B → A moves a vertex at most, over the longest edge."""
    return pairs.there_and_back(pair.a, pair.b, found.map) / pairs.longest_edge(pair.a)


def error_of(pair: Pair, found: MapResult) -> float:
    """Mean distance of the vertices of the first surface from where they belong, in sizes."""
    image = found.map.to_b.of(pair.b.points, pair.b.faces)
    return float(np.linalg.norm(image - pair.truth, axis=1).mean()) / size_of(pair.a)


def row(pair: Pair, found: MapResult, seconds: float) -> list[str]:
    """One line of the table."""
    there = found.a_to_b
    return [
        pair.name, f"{len(pair.a.faces)} / {len(pair.b.faces)}", str(len(pair.marks)),
        str(sum(found.inversions)), f"{found.landmark_error:.1g}", f"{found.start.mean:.4f}",
        f"{there.mean:.4f}", f"{there.p99:.3f}", f"{there.largest:.3g}", f"{found.b_to_a.mean:.4f}",
        f"{moved_back(pair, found):.2f}",
        "" if pair.truth is None else f"{100 * error_of(pair, found):.3f} %", f"{seconds:.1f}",
    ]  # fmt: skip


HEADS = (
    "pair", "faces", "landmarks", "inversions", "landmark error", "composed", "relaxed A → B", "99 %", "max",
    "B → A", "there and back / longest edge", "mean error", "CPU s",
)  # fmt: skip


def overlays(all_of_them: list[Pair]) -> Line:
    """How far the way through the overlay moves the vertices of closed surfaces, in sizes."""
    chosen = [p for p in all_of_them if p.name in OVERLAID]
    moved = []
    for pair in chosen:
        found, _ = mapped(pair, overlay=True)
        moved.append(pairs.back_through_overlay(pair.a, pair.b, found.map) / size_of(pair.a))
        parts, seconds = len(found.map.overlay.faces), found.seconds["overlay"]
        print(pair.name, parts, moved[-1], seconds, flush=True)
    note = f"{len(chosen)} pairs: {', '.join(p.name for p in chosen)}"
    name = "A → B → A through the overlay, largest move"
    return Line(name, max(moved), "sizes", "<= 1e-6", note)


def speed() -> list[Line]:
    """50k faces against 50k, about 200k, and about 500k."""
    out, seconds = [], []
    for step in (0.0445, 0.0222, 0.0141):
        a, b = creature(step), creature(step * 1.01, 0.37)
        found, took = mapped(Pair("", a, b, nearest_marks(a, b, TIPS)))
        seconds.append(took / len(a.faces))
        name = f"CPU seconds, {len(a.faces)} against {len(b.faces)} faces"
        note = f"distortion {found.a_to_b.mean:.4f}, {sum(found.inversions)} inversions"
        out.append(Line(name, took, "s", "<= 20" if step == 0.0445 else None, note))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return [
        *out,
        Line("CPU a face, 200k / 50k", seconds[1] / seconds[0]),
        Line("CPU a face, 500k / 50k", seconds[2] / seconds[0]),
        Line("largest memory", peak, "GiB", "<= 4"),
    ]


def verdicts(results: list[tuple[Pair, MapResult]], composed: np.ndarray) -> list[Line]:
    """What is wanted of all pairs; composed (pairs, methods): distortion before relaxation."""
    known = [error_of(p, f) for p, f in results if p.truth is not None]
    turned = sum(sum(f.inversions) for _, f in results)
    marks = max(f.landmark_error for _, f in results)
    back = max(moved_back(p, f) for p, f in results)
    worst = 100 * max(known, default=0.0)
    medians = zip(METHODS, np.median(composed, 0).tolist(), strict=True)
    return [
        Line("inversions, both ways, all pairs", turned, "", "<= 0"),
        Line("landmark error, largest", marks, "sizes", "<= 1e-9"),
        Line("A → B → A, largest move over the longest edge", back, "", "<= 1"),
        Line("known answer, largest mean error", worst, "% of the size", "<= 0.5"),
        *(Line(f"composed maps, {name}: median distortion", value) for name, value in medians),
    ]


def main() -> None:
    """Run all pairs, the weights, and the speed."""
    parser = common.options(__doc__)
    parser.add_argument("--no-speed", action="store_true", help="leave out the large pairs")
    parser.add_argument("pairs", nargs="*", metavar="PAIR", help="names of pairs; all if left out")
    chosen = parser.parse_args()
    rows, composed, weights, results = [], [], [], []
    for pair in all_pairs():
        if chosen.pairs and pair.name not in chosen.pairs:
            continue
        found, seconds = mapped(pair)
        results.append((pair, found))
        rows.append(row(pair, found, seconds))
        plain = [mapped(pair, method=m, relax=False)[0] for m in METHODS]
        composed.append([r.a_to_b.mean for r in plain])
        turned = str(sum(sum(r.inversions) for r in plain))
        weights.append([pair.name, *(f"{x:.4f}" for x in composed[-1]), turned])
        print(" | ".join([*rows[-1], *weights[-1][1:]]), flush=True)
    lines = verdicts(results, np.array(composed))
    if not chosen.pairs:
        lines.append(overlays([p for p, _ in results]))
    if not chosen.no_speed:
        lines += speed()
    blocks = [common.wanted(lines), common.section("All pairs", common.table(HEADS, rows))]
    title = "The weights: distortion of the composed convex maps, before relaxation"
    table = common.table(("pair", *METHODS, "inversions"), weights)
    blocks.append(common.section(title, table))
    if chosen.no_report or chosen.pairs:
        return
    intro = (
        "Made by `make bench-maps`; pairs from the scripts of data/ and tests/support. Distortion: symmetric "
        "Dirichlet energy / 4, mean over the area, 1 is an isometry. Mean error: distance of the vertices of A "
        "from where they belong, in diagonals of the box."
    )
    common.write("maps.md", "Maps between surfaces", intro, blocks)
