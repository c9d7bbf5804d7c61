"""Faults planted on purpose, and the share of them that the tests of their module notice.

    python -m tests.tools.mutants [--sample 200] [--seed 1] [--only packing/] [--no-report]

A fixed sample of places in the package gets one mutant each (an operator of cosmic-ray: a changed comparison,
sign, number, break, condition), in a copy of the tree. The tests of the mutated module run on it; a mutant is
noticed when they fail or run out of time. The share and the survivors go to docs/benchmarks/mutants.md, where
each survivor has a judgement that is kept from run to run. Real meshes are left out: the sample is judged by
what every machine has.
"""

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import Any

from tests.bench.common import REPORTS, ROOT, options, section, table, write
from tests.tools.planting import Mutant, sample

PACKAGE = "circparam"
# rooms that are mutated: all that compute or keep a promise of a file; the others pass on what these answer
ROOMS = (
    *("core", "mesh", "geometry", "solvers", "methods", "seams", "packing", "formats"),
    *("pipeline", "maps", "render", "bake"),
)
WORKERS = 2
ENOUGH = 0.85  # share that is to be noticed
REPORT = "mutants.md"
LEFT_OUT = (".git", ".venv", "__pycache__", ".*_cache", ".hypothesis", "*.egg-info", "node_modules")


def tests_of(module: str) -> tuple[str, ...]:
    """The tests of a module, from the root of the tree: tests/ mirrors the package.

    circparam/ROOM/[SUB/]MODULE.py has tests/ROOM/[SUB/]test_MODULE.py, or else the tests of its room that
    import it, or else all of tests/ROOM.
    """
    path = Path(module).relative_to(PACKAGE)
    room = ROOT / "tests" / path.parts[0]
    own = ROOT / "tests" / path.with_name(f"test_{path.name}")
    package, name = ".".join(Path(module).parent.parts), path.stem
    called = re.compile(rf"{package}\.{name}\b|from {package} import .*\b{name}\b")
    users = [f for f in sorted(room.rglob("test_*.py")) if called.search(f.read_text("utf-8"))]
    found = [own] if own.is_file() else users or [room]
    return tuple(f.relative_to(ROOT).as_posix() for f in found)


def modules(only: str) -> list[str]:
    """Files that are mutated, whose names hold a text."""
    found = [p for room in ROOMS for p in sorted((ROOT / PACKAGE / room).rglob("*.py"))]
    names = [p.relative_to(ROOT).as_posix() for p in found if p.name != "__init__.py"]
    return [n for n in names if only in n]


# the runs -----------------------------------------------------------------------------------------


class Copies:
    """Copies of the tree, one for each process that runs beside another; no other file is changed."""

    def __init__(self, folder: Path) -> None:
        folder = folder.resolve()
        self.free: Queue[Path] = Queue()
        for k in range(WORKERS):
            root = folder / str(k)
            shutil.copytree(ROOT, root, ignore=shutil.ignore_patterns(*LEFT_OUT))
            ask = [sys.executable, "-c", f"import {PACKAGE}; print({PACKAGE}.__file__)"]
            used = subprocess.check_output(ask, cwd=root, env=_environment(root), text=True)
            if not Path(used.strip()).is_relative_to(root):
                sys.exit(f"tests would import {used.strip()}, not the copy in {root}")
            self.free.put(root)

    def run(self, tests: tuple[str, ...], bound: float | None, mutant: Mutant | None = None) -> Any:
        """(exit code of the tests, None where they ran out of time; seconds; last lines)."""
        root = self.free.get()
        path = None if mutant is None else root / mutant.file
        clean = "" if path is None else path.read_text(encoding="utf-8")
        try:
            if path is not None and mutant is not None:
                path.write_text(mutant.source, encoding="utf-8")
            return _pytest(root, tests, bound)
        finally:
            if path is not None:
                path.write_text(clean, encoding="utf-8")
            self.free.put(root)


def _environment(root: Path) -> dict[str, str]:
    return {
        **os.environ,
        "PYTHONPATH": str(root),
        # two mutants of a file can have one size and one second: stored bytecode would be that of the first
        "PYTHONDONTWRITEBYTECODE": "1",
        "CIRCPARAM_CORPUS": str(root / "none"),
    }


def _pytest(
    root: Path, tests: tuple[str, ...], bound: float | None
) -> tuple[int | None, float, str]:
    words = ["-m", "pytest", "-q", "-x", "-p", "no:randomly", "-p", "no:cacheprovider"]
    start = time.perf_counter()
    with tempfile.TemporaryFile("w+") as out:
        process = subprocess.Popen(
            [sys.executable, *words, "--hypothesis-seed=0", *tests],
            cwd=root, env=_environment(root), stdout=out, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
        try:
            code: int | None = process.wait(bound)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # its own group: workers of the tests too
            process.wait()
            code = None
        out.seek(0)
        tail = "\n".join(out.read().splitlines()[-15:])
    return code, time.perf_counter() - start, tail


def noticed(mutants: list[Mutant]) -> list[bool]:
    """Whether the tests of its module fail with each mutant."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(WORKERS) as pool:
        copies = Copies(Path(folder))
        sets = sorted({tests_of(m.file) for m in mutants})
        clean: dict[tuple[str, ...], float] = {}
        for tests, (code, seconds, tail) in zip(
            sets, pool.map(lambda tests: copies.run(tests, None), sets), strict=True
        ):
            if code != 0:
                sys.exit(f"{' '.join(tests)}: fails without a mutant:\n{tail}")
            clean[tests] = seconds
            print(f"{' '.join(tests)}: {seconds:.0f} s", flush=True)

        def seen(mutant: Mutant) -> bool:
            tests = tests_of(mutant.file)
            code, seconds, _ = copies.run(tests, 3 * clean[tests] + 30, mutant)
            word = {0: "SURVIVES", None: "out of time"}.get(code, "noticed")
            told = f"{mutant.file}:{mutant.line}: {mutant.before} -> {mutant.after}"
            print(f"{word} ({seconds:.0f} s) {told}", flush=True)
            return code != 0

        return list(pool.map(seen, mutants))


# the report ---------------------------------------------------------------------------------------


def _cell(code: str) -> str:
    """A piece of code in a Markdown table."""
    return "`" + code.replace("|", "\\|").replace("`", "'") + "`"


def judgements(path: Path) -> dict[tuple[str, ...], str]:
    """(file, before, after) as cells → judgement, from the last report."""
    old: dict[tuple[str, ...], str] = {}
    if path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            cells = [c.strip() for c in re.split(r"(?<!\\)\|", line)][1:-1]
            if len(cells) == 4 and cells[0].startswith(PACKAGE):
                old[cells[0].rsplit(":", 1)[0], cells[1], cells[2]] = cells[3]
    return old


def report(mutants: list[Mutant], found: list[bool], told: argparse.Namespace) -> Path:
    """Write docs/benchmarks/mutants.md; judgements of survivors that were there before stay."""
    old = judgements(REPORTS / REPORT)
    rooms: dict[str, list[bool]] = defaultdict(list)
    rows = []
    for mutant, seen in sorted(
        zip(mutants, found, strict=True), key=lambda p: (p[0].file, p[0].line)
    ):
        rooms["/".join(mutant.file.split("/")[1:2])].append(seen)
        if not seen:
            before, after = _cell(mutant.before), _cell(mutant.after)
            judged = old.get((mutant.file, before, after), "")
            rows.append([f"{mutant.file}:{mutant.line}", before, after, judged])
    share = [[room, str(len(s)), f"{sum(s) / len(s):.0%}"] for room, s in sorted(rooms.items())]
    intro = (
        f"{len(mutants)} faults planted one at a time (seed {told.seed}), each with the tests of its module: "
        f"{sum(found)} noticed, {sum(found) / len(found):.1%}. Made by `make mutants`; the judgements are "
        "written by hand and kept."
    )
    survivors = table(["place", "before", "after", "judgement"], rows)
    blocks = [table(["room", "planted", "noticed"], share), section("Survivors", survivors)]
    return write(REPORT, "Planted faults", intro, blocks)


def main() -> int:
    """Plant, run, report; exit 1 where too few are noticed."""
    parser = options(__doc__)
    parser.add_argument("--sample", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="modules whose name holds this text")
    parser.add_argument("--list", action="store_true", help="show the sample and run nothing")
    told = parser.parse_args()
    mutants = sample(modules(told.only), told.sample, told.seed)
    if not mutants:
        sys.exit(f"no module to mutate holds '{told.only}' in its name")
    if told.list:
        print("\n".join(f"{m.file}:{m.line}: {m.before} -> {m.after}" for m in mutants))
        return 0
    found = noticed(mutants)
    if not told.no_report:
        print(f"\n{report(mutants, found, told).relative_to(ROOT)} is written")
    print("\nsurvivors:")
    for mutant, seen in zip(mutants, found, strict=True):
        if not seen:
            print(f"  {mutant.file}:{mutant.line}: {mutant.before} -> {mutant.after}")
    share = sum(found) / len(found)
    print(f"\n{sum(found)} of {len(found)} mutants noticed: {share:.1%}, wanted {ENOUGH:.0%}")
    return int(share < ENOUGH)


if __name__ == "__main__":
    sys.exit(main())
