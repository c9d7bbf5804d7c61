"""``make bench-batch``: rates, memory and overhead of a batch; writes docs/benchmarks/batch.md.

    python -m tests.bench batch [rate] [empty] [--meshes N] [--tasks N] [--no-report]

rate: generated meshes of 300 to 3,000 faces on two workers, beside one warm process and beside
``xargs -P2 circparam unwrap``, both on every so many-th of them. Seconds of the clock say something on a quiet
machine alone; processor seconds are told beside. empty: tasks that do nothing, for what the client
costs.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil

import circparam
from circparam.batch.batch import run_batch
from circparam.batch.process import WarmServer
from circparam.batch.progress import Progress
from circparam.batch.run import BatchPlan, Hooks
from circparam.batch.settings import Settings
from circparam.cli import exits
from circparam.core.workers import environment
from circparam.pipeline.gates import Gates
from circparam.pipeline.options import Options
from tests.bench.common import Line, children_seconds, options, run_cases
from tests.support import shapes
from tests.support.batch_faults import empty_item
from tests.support.shapes import Shape
from tests.support.writers import obj

WORKERS = 2
TURNS = 14  # meshes that are done both ways in turns


def generated(number: int) -> Shape:
    """A mesh of 300 to 3,000 faces: hills, bumpy spheres, tubes, tori, boxes."""
    rng = np.random.default_rng(number)
    wanted = int(np.exp(rng.uniform(np.log(300), np.log(3000))))
    kind = number % 5
    side = int(np.sqrt(wanted / 2))
    if kind == 0:
        p, f = shapes.waved(shapes.grid(side, side), rng.uniform(0.1, 0.4))
    elif kind == 1:
        p, f = shapes.torus(2 * side // 2, side)
    elif kind == 2:
        p, f = shapes.cylinder(side, side, caps=bool(rng.integers(2)))
    elif kind == 3:
        p, f = shapes.icosphere(2 if wanted < 900 else 3)
    else:
        p, f = shapes.cube(max(2, int(np.sqrt(wanted / 12))))
    wave = np.sin(p @ rng.normal(0, 2, (3, 3)))
    return p * rng.uniform(0.5, 2, 3) + 0.08 * wave * (kind != 4), f


def write_meshes(folder: Path, count: int) -> list[Path]:
    """So many generated meshes as OBJ."""
    folder.mkdir(parents=True)
    out = [folder / f"m{k:05d}.obj" for k in range(count)]
    for k, path in enumerate(out):
        path.write_bytes(obj(*generated(k)))
    return out


def settings(out: Path) -> Settings:
    """The default options."""
    return Settings(Options(), Gates(), str(out), exits.exit_of)


def cpu_of_tree(root: psutil.Process) -> float:
    """Processor seconds of a process, of those below it, and of those that have ended below it."""
    total = 0.0
    for process in [root, *root.children(recursive=True)]:
        try:
            total += sum(process.cpu_times()[:4])
        except psutil.Error:
            continue
    return total


WARM = """
import sys, time, circparam
circparam.unwrap(sys.argv[1], sys.argv[1] + ".warm.obj", overwrite=True)
start, cpu = time.perf_counter(), time.process_time()
for path in sys.argv[2:]:
    circparam.unwrap(path, path + ".warm.obj", overwrite=True)
print(time.perf_counter() - start, time.process_time() - cpu)
"""


def in_turns(meshes: list[Path], folder: Path) -> Line:
    """Processor seconds of a warm process and of forks, mesh by mesh in turns: load is the same for both."""
    given = settings(folder)
    (folder / "turns").mkdir()
    own = forked = 0.0
    target = str(folder / "turns" / "m.obj")
    task = {"settings": given, "target": target, "name": "m.obj", "scratch": str(folder / "turns")}
    server = WarmServer(True)
    circparam.unwrap(str(meshes[0]), target, overwrite=True, jobs=1)
    for mesh in meshes:
        start = time.process_time()
        circparam.unwrap(str(mesh), target, overwrite=True, jobs=1)
        own += time.process_time() - start
        forked += server.ask({**task, "source": str(mesh)}, None, None)["cpu"]
    server.close()
    n = len(meshes)
    told = f"in turns, {n} meshes: {own / n:.3f} and {forked / n:.3f} s"
    return Line("CPU a mesh, warm / forked", own / forked, "", None, told)


def rate(chosen: argparse.Namespace) -> list[Line]:
    """Meshes a second of a batch, of one warm process, and of xargs."""
    count = chosen.meshes
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        meshes = write_meshes(folder / "src", count)
        few = [str(p) for p in meshes[:: max(1, count // 50)]]
        warm = subprocess.run(
            [sys.executable, "-c", WARM, few[0], *few], env=environment(), capture_output=True, text=True,
            check=True,
        )  # fmt: skip
        seconds, cpu = map(float, warm.stdout.split())
        for path in (folder / "src").glob("*.warm.obj"):
            path.unlink()
        warm_rate, warm_cpu = len(few) / seconds, cpu / len(few)
        start, before = time.perf_counter(), children_seconds()
        one = f"{sys.executable} -P -m circparam unwrap -q --out-dir {folder / 'x'}"
        script = f"printf '%s\\0' \"$@\" | xargs -0 -n1 -P{WORKERS} {one}"
        (folder / "x").mkdir()
        subprocess.run(["sh", "-c", script, "sh", *few], env=environment(), check=True)
        xargs_rate = len(few) / (time.perf_counter() - start)
        xargs_cpu = (children_seconds() - before) / len(few)
        told = f"warm {warm_rate:.3g}/s, xargs {xargs_rate:.3g}/s, {xargs_cpu:.3g} s CPU each"
        print(told, flush=True)
        spent: list[tuple[int, float, float]] = []

        def on_line(line: dict[str, Any]) -> None:
            looked = len(spent) % 10 == 0 or len(spent) >= count - 5
            cpu = cpu_of_tree(psutil.Process()) if looked else spent[-1][2]
            spent.append((len(spent) + 1, time.perf_counter(), cpu))

        plan = BatchPlan([str(folder / "src")], settings(folder / "out"), workers=WORKERS)
        summary = run_batch(plan, Hooks(on_line=on_line))
        first, last = spent[0], spent[-1]
        batch_rate = (last[0] - first[0]) / (last[1] - first[1])
        batch_cpu = (last[2] - first[2]) / (last[0] - first[0])
        told = f"{summary.counts}, {summary.seconds:.0f} s in all"
        return [
            Line("one warm process", warm_rate, "meshes/s", None, f"{warm_cpu:.3f} s CPU a mesh"),
            Line("batch, 2 workers", batch_rate, "meshes/s", None, f"{batch_cpu:.3f} s CPU a mesh; {told}"),
            Line("batch / (2 x warm)", batch_rate / (WORKERS * warm_rate), "", ">= 0.9"),
            Line("CPU a mesh, warm / batch", warm_cpu / batch_cpu, "", None, "one by one: load counts"),
            in_turns(meshes[:TURNS], folder),
            Line("CPU a mesh, xargs / batch", xargs_cpu / batch_cpu, "", None, f"{xargs_cpu:.3f} s"),
            Line("batch / xargs -P2", batch_rate / xargs_rate, "", ">= 2.5", f"{xargs_rate:.3g} meshes/s"),
        ]  # fmt: skip


def empty(chosen: argparse.Namespace) -> list[Line]:
    """What a task costs the client with its scheduler, and their memory."""
    count = chosen.tasks
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for k in range(count):
            sub = folder / "src" / f"{k // 1000:04d}"
            if k % 1000 == 0:
                sub.mkdir(parents=True)
            (sub / f"{k:07d}.obj").touch()
        memory: list[tuple[int, float]] = []

        def listen(progress: Progress) -> None:
            memory.append((progress.done, psutil.Process().memory_info().rss / 1e6))
            if len(memory) % 60 == 1:
                print(memory[-1], f"{progress.rate:.0f}/s", flush=True)

        start, cpu = time.perf_counter(), time.process_time()
        where = [str(folder / "src")], settings(folder / "out")
        plan = BatchPlan(*where, workers=WORKERS, task=empty_item)
        summary = run_batch(plan, Hooks(listener=listen))
        seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
        assert summary.counts == {"ok": count}, summary
        page = (folder / "out" / "report.html").stat().st_size / 1e6
        half = [m for m in memory if m[0] >= count / 2] or memory
        return [
            Line("client, CPU a task", 1e3 * cpu / count, "ms", "<= 5", "listing to report"),
            Line("tasks", count / seconds, "1/s", None, f"{count} in {seconds:.0f} s of the clock"),
            Line("memory of the client", max(m[1] for m in memory), "MB", "<= 500"),
            Line("client, growth over the last half", half[-1][1] - half[0][1], "MB", "<= 10"),
            Line("report.html", page, "MB", "<= 5", "the first 10,000 of them"),
        ]  # fmt: skip


def page(chosen: argparse.Namespace) -> tuple[str, str, str]:
    """File, title and intro of the report."""
    intro = (
        f"{chosen.meshes} generated meshes of 300 to 3,000 faces, {chosen.tasks} tasks that do nothing. "
        "Made by `make bench-batch`."
    )
    return "batch.md", "Batch", intro


def main() -> None:
    """Run what is named, both if nothing is."""
    parser = options(__doc__)
    parser.add_argument("--meshes", type=int, default=1000)
    parser.add_argument("--tasks", type=int, default=100_000)
    run_cases(parser, rate, empty, page=page)
