"""``make bench``: how fast the methods are, beside libigl in the same run; writes docs/benchmarks/solve.md.

    python -m tests.bench solve [CASE...]

Every figure is a ratio of two times of the same run, or a peak memory; each method runs in a process of its
own. Meshes are generated, and those of the corpus folder (CIRCPARAM_CORPUS) are added where it exists.
"""

import statistics
from argparse import Namespace
from typing import Any

import numpy as np

from circparam import formats
from circparam.core import own_process
from circparam.core.own_process import Outcome
from circparam.mesh.cut_mesh import CutMesh
from tests.bench import tasks
from tests.bench.common import Line, options, run_cases
from tests.support import shapes
from tests.support.atlases import uncut
from tests.support.corpus import CORPUS

REPEATS = 5
GIGABYTE = 2**30
# disks of the corpus with at least 20k faces
LARGE_DISKS = (
    "face_libigl.obj", "camelhead.off", "mountain.obj", "SheenCloth.glb", "zero_area_48.obj",
)  # fmt: skip


def run(task: str, arrays: dict[str, Any], **settings: Any) -> Outcome:
    """A task in its own process; an error there ends the benchmark here."""
    done = own_process.run(f"tests.bench.tasks:{task}", arrays, settings)
    if done.error is not None:
        raise SystemExit(f"{task}: {done.error}")
    return done


def flatten(cut_mesh: CutMesh, method: str, repeats: int = 1, **options: Any) -> Outcome:
    """A method on cut mesh."""
    arrays = tasks.arrays_of(cut_mesh)
    return run("flatten", arrays, method=method, repeats=repeats, options=options)


def convex(_: Namespace) -> list[Line]:
    """100k vertices: circle beside libigl's harmonic and beside floater."""
    points, faces = shapes.bumped_disk(100_000 - 1121)
    cut_mesh = uncut(points, faces).cut_mesh()
    circle, floater = (flatten(cut_mesh, name, REPEATS) for name in ("circle", "floater"))
    peer = run("harmonic_by_igl", {"points": points, "faces": faces}, repeats=REPEATS)
    stages = zip(circle.info["weights"], circle.info["solve"], strict=True)
    own = statistics.median(map(sum, stages))
    theirs = statistics.median(peer.info["seconds"])
    fast, slow = (statistics.median(d.info["weights"]) for d in (circle, floater))
    size = f"{cut_mesh.n_vertices} vertices, {len(faces)} faces"
    return [
        Line("circle, weights + solve, time / libigl harmonic", own / theirs, "", "<= 1",
             f"{own:.3f} s / {theirs:.3f} s; {size}"),
        Line("weight stage, floater / circle", slow / fast, "", ">= 1.5", f"{slow:.3f} s / {fast:.3f} s"),
    ]  # fmt: skip


def million(_: Namespace) -> list[Line]:
    """1M vertices: memory, and how time grows."""
    small = uncut(*shapes.bumped_disk(100_000 - 1121)).cut_mesh()
    a = flatten(small, "circle", REPEATS)
    del small
    large = uncut(*shapes.bumped_disk(1_000_000 - 3545)).cut_mesh()
    b = flatten(large, "circle")
    first = statistics.median(a.info["seconds"])
    last = b.info["seconds"][0]
    return [
        Line("1M vertices, time / time of 100k", last / first, "", "<= 40", f"{last:.2f} s / {first:.3f} s"),
        Line("1M vertices, peak memory", (b.peak_bytes or 0) / GIGABYTE, "GB", "<= 3",
             f"{large.n_vertices} vertices, beyond the input"),
    ]  # fmt: skip


def first_within(cut_mesh: CutMesh, enough: float, steps: int, **options: Any) -> tuple[int, float]:
    """(fewest steps of isometric to an energy of ``enough``, seconds of the run that stops there).

    steps: a number that suffices. The energy falls with every step, so halving finds the fewest.
    """
    low, high = 1, max(steps, 1)
    while low < high:
        middle = (low + high) // 2
        done = flatten(cut_mesh, "isometric", max_iterations=middle, **options)
        reached = tasks.energy(cut_mesh, done.arrays["uv"]) <= enough
        low, high = (low, middle) if reached else (middle + 1, high)
    done = flatten(cut_mesh, "isometric", max_iterations=high, **options)
    return high, done.info["seconds"][0]


def newton(_: Namespace) -> list[Line]:
    """Isometric: steps on a bumped disk of 39k faces, memory at 400k faces."""
    cut_mesh = uncut(*shapes.bumped_disk(19_500 - 495)).cut_mesh()
    done = flatten(cut_mesh, "isometric", start="mean-value")
    steps = done.info["iterations"][0]
    best = tasks.energy(cut_mesh, done.arrays["uv"])
    near, _ = first_within(cut_mesh, best * (1 + 1e-6), steps, start="mean-value")
    lines = [
        Line("39k faces, Newton steps from a mean-value start to within 1e-6 of the optimum", near, "", "<= 5",
             f"{len(cut_mesh.faces)} faces, SD/4 {best:.6f}; it stops by itself after {steps} steps, "
             f"{done.info['seconds'][0]:.2f} s")
    ]  # fmt: skip
    cut_mesh = uncut(*shapes.bumped_disk(200_000 - 1585)).cut_mesh()
    done = flatten(cut_mesh, "isometric")
    return [
        *lines,
        Line("400k faces, isometric, peak memory", (done.peak_bytes or 0) / GIGABYTE, "GB", "<= 6",
             f"{len(cut_mesh.faces)} faces, {done.info['seconds'][0]:.1f} s"),
    ]  # fmt: skip


def blocks(_: Namespace) -> list[Line]:
    """1000 charts of 40 faces beside one chart of 40k faces."""
    bend = lambda p: p + [0, 0, 1] * (0.3 * np.sin(3 * p[:, :1]) * np.cos(2 * p[:, 1:2]))  # noqa: E731
    p, f = shapes.grid(6, 5)
    many = uncut(*shapes.row_of((bend(p), f), 1000)).cut_mesh()
    p, f = shapes.grid(201, 101)
    one = uncut(bend(p), f).cut_mesh()
    lines = []
    for method in ("circle", "lscm", "isometric"):
        times = [min(flatten(x, method, 3).info["seconds"]) for x in (many, one)]
        lines.append(
            Line(f"{method}: 1000 charts of 40 faces, time / one chart of 40k", times[0] / times[1], "",
                 "<= 1.5", f"{times[0]:.2f} s / {times[1]:.2f} s, {len(many.faces)} and {len(f)} faces")
        )  # fmt: skip
    return lines


def slim(_: Namespace) -> list[Line]:
    """Isometric beside libigl's SLIM: seconds to the first iterate within 0.1 % of the minimum.

    circparam's time includes its start. SLIM's is that of its set-up and its steps from the same start, which
    it is given.
    """
    lines = []
    for name, cut_mesh, points in _slim_meshes():
        own = flatten(cut_mesh, "isometric")
        start = flatten(cut_mesh, "circle")
        best = tasks.energy(cut_mesh, flatten(cut_mesh, "isometric", tolerance=1e-12).arrays["uv"])
        reached = tasks.energy(cut_mesh, own.arrays["uv"])
        steps, seconds = first_within(cut_mesh, 1.001 * best, own.info["iterations"][0])
        arrays = {**tasks.arrays_of(cut_mesh), "points": points, "uv": start.arrays["uv"]}
        peer = run("slim_by_igl", arrays, iterations=300, bound=60 * seconds, enough=1.001 * best)
        theirs, count = peer.info["seconds"][-1], len(peer.info["energies"])
        sign = "" if peer.info["energies"][-1] <= 1.001 * best else "more than "
        lines.append(
            Line(f"{name}: SLIM's time / isometric's", theirs / seconds, "", ">= 2",
                 f"{sign}{theirs:.2f} s in {count} steps / {seconds:.2f} s in {steps} steps; "
                 f"{len(cut_mesh.faces)} faces, SD/4 {best:.5f}")
        )  # fmt: skip
        lines.append(
            Line(f"{name}: SD/4 where isometric stops / minimum", reached / best, "", "<= 1.001",
                 f"{own.info['seconds'][0]:.2f} s")
        )  # fmt: skip
    return lines


def _slim_meshes() -> list[tuple[str, CutMesh, np.ndarray]]:
    """(name, cut mesh, points of their vertices) of disks with 20k faces and more."""
    made = [
        ("bumped disk", shapes.bumped_disk(19_500 - 495)),
        ("hemisphere", shapes.hemisphere(82)),
        ("tube, length / circumference 1.5", shapes.tube(1.5, 96)),
    ]
    for name in LARGE_DISKS:
        if (CORPUS / name).exists():
            mesh = formats.read(CORPUS / name).mesh
            made.append((name, (mesh.points, mesh.weld[mesh.faces])))
    out = []
    for name, (p, f) in made:
        cut_mesh = uncut(p, f).cut_mesh()
        if (cut_mesh.n_charts, cut_mesh.n_vertices) != (1, len(np.unique(f))) or len(
            cut_mesh.faces
        ) != len(f):
            continue  # SLIM needs the one disk as it is, without repairs
        points = np.zeros((cut_mesh.n_vertices, 3))
        points[cut_mesh.faces.ravel()] = p[f.ravel()]
        out.append((name, cut_mesh, points))
    return out


def main() -> None:
    """Run the cases."""
    intro = "Made by `make bench`. Ratios of times of one run; each method in a process of its own."
    page = ("solve.md", "Speed of the solvers", intro)
    run_cases(options(__doc__), convex, million, newton, blocks, slim, page=lambda _: page)
