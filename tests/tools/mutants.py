"""Faults planted on purpose, and the share of them that the tests of their room notice.

    python -m tests.tools.mutants [ROOM...] [--sample 20] [--seed 1] [--minutes 60] [--no-report]

A sample of places in each room gets one mutant each (an operator of cosmic-ray: a changed comparison, sign,
number, break, condition), in a copy of the tree. The tests of the mutated module run on the mutant, then those
of its room. They notice it when they fail or run out of time. Rooms take turns, so a run that its minutes end
has tried all rooms alike. The shares and the survivors go to docs/benchmarks/mutants.md, where each survivor
has a judgement that is kept from run to run. Real meshes are left out, because the sample is judged by the
tests that every machine can run.
"""

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
from itertools import zip_longest
from pathlib import Path
from queue import Queue
from threading import Lock
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


def tests_of(module: str) -> list[tuple[str, ...]]:
    """The tests of a module, then those of its room, from the root of the tree: tests/ mirrors the package.

    circparam/ROOM/[SUB/]MODULE.py has tests/ROOM/[SUB/]test_MODULE.py, or else the tests of its room that
    import it.
    """
    path = Path(module).relative_to(PACKAGE)
    room = ROOT / "tests" / path.parts[0]
    own = ROOT / "tests" / path.with_name(f"test_{path.name}")
    package, name = ".".join(Path(module).parent.parts), path.stem
    called = re.compile(rf"{package}\.{name}\b|from {package} import .*\b{name}\b")
    users = [f for f in sorted(room.rglob("test_*.py")) if called.search(f.read_text("utf-8"))]
    rounds = [[own] if own.is_file() else users, [room]]
    return [tuple(f.relative_to(ROOT).as_posix() for f in found) for found in rounds if found]


def modules(room: str) -> list[str]:
    """Files of a room, or of a folder in it, that are mutated."""
    found = sorted((ROOT / PACKAGE / room).rglob("*.py"))
    return [p.relative_to(ROOT).as_posix() for p in found if p.name != "__init__.py"]


def planned(rooms: list[str], size: int, seed: int) -> list[Mutant]:
    """So many mutants of each room, the first of every room before the second of any."""
    drawn = [sample(modules(room), size, seed) for room in rooms]
    return [m for turn in zip_longest(*drawn) for m in turn if m is not None]


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


class Trial:
    """Mutants tried one by one, by tests that pass without them."""

    def __init__(self, folder: Path, end: float) -> None:
        self.copies, self.end = Copies(folder), end
        self.clean: dict[tuple[str, ...], float] = {}
        self.locks: dict[tuple[str, ...], Lock] = defaultdict(Lock)

    def seconds(self, tests: tuple[str, ...]) -> float:
        """How long some tests take without a mutant; the first call runs them."""
        with self.locks[tests]:
            if tests not in self.clean:
                code, seconds, tail = self.copies.run(tests, None)
                if code != 0:
                    raise SystemExit(f"{' '.join(tests)}: fails without a mutant:\n{tail}")
                self.clean[tests] = seconds
        return self.clean[tests]

    def notices(self, mutant: Mutant) -> bool | None:
        """Whether the tests fail with a mutant; None where no time is left to try."""
        if time.monotonic() > self.end:
            return None
        start, word = time.monotonic(), "SURVIVES"
        for tests in tests_of(mutant.file):
            code, _, _ = self.copies.run(tests, 3 * self.seconds(tests) + 30, mutant)
            if code != 0:
                word = "noticed" if code else "out of time"
                break
        print(f"{word} ({time.monotonic() - start:.0f} s) {line_of(mutant)}", flush=True)
        return word != "SURVIVES"


def tried(mutants: list[Mutant], minutes: float) -> list[tuple[Mutant, bool]]:
    """The mutants for which there was time, and whether the tests notice each."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(WORKERS) as pool:
        trial = Trial(Path(folder), time.monotonic() + 60 * minutes)
        found = list(pool.map(trial.notices, mutants))
    return [(m, seen) for m, seen in zip(mutants, found, strict=True) if seen is not None]


def line_of(mutant: Mutant) -> str:
    """One line that names a mutant."""
    return f"{mutant.file}:{mutant.line}: {mutant.before} -> {mutant.after}"


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


def report(found: list[tuple[Mutant, bool]], seed: int) -> None:
    """Write docs/benchmarks/mutants.md; judgements of survivors that were there before stay."""
    old = judgements(REPORTS / REPORT)
    rooms: dict[str, list[bool]] = defaultdict(list)
    rows = []
    for mutant, seen in sorted(found, key=lambda pair: (pair[0].file, pair[0].line)):
        rooms[mutant.file.split("/")[1]].append(seen)
        if not seen:
            before, after = _cell(mutant.before), _cell(mutant.after)
            judged = old.get((mutant.file, before, after), "")
            rows.append([f"{mutant.file}:{mutant.line}", before, after, judged])
    share = [[room, str(len(s)), f"{sum(s) / len(s):.0%}"] for room, s in sorted(rooms.items())]
    intro = (
        f"{len(found)} faults planted one at a time (seed {seed}), each with the tests of its room: "
        f"{len(found) - len(rows)} noticed, {1 - len(rows) / len(found):.1%}. Made by `make mutants`; the "
        "judgements are written by hand and kept."
    )
    survivors = table(["place", "before", "after", "judgement"], rows)
    blocks = [table(["room", "planted", "noticed"], share), section("Survivors", survivors)]
    write(REPORT, "Planted faults", intro, blocks)


def main() -> int:
    """Plant, run, report; exit 1 where too few are noticed."""
    parser = options(__doc__)
    parser.add_argument(
        "rooms", nargs="*", metavar="ROOM", help=f"of: {', '.join(ROOMS)}; or below"
    )
    parser.add_argument("--sample", type=int, default=20, help="mutants of each room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=60.0, help="no mutant begins after them")
    chosen = parser.parse_args()
    mutants = planned(chosen.rooms or list(ROOMS), chosen.sample, chosen.seed)
    if not mutants:
        sys.exit(f"no module to mutate in {' '.join(chosen.rooms)}")
    found = tried(mutants, chosen.minutes)
    if not found:
        sys.exit(f"no mutant was tried within {chosen.minutes:g} minutes")
    if not chosen.no_report:
        report(found, chosen.seed)
    print("\nsurvivors:", *(f"  {line_of(m)}" for m, seen in found if not seen), sep="\n")
    share = sum(seen for _, seen in found) / len(found)
    print(f"\n{len(found)} of {len(mutants)} tried: {share:.1%} noticed, wanted {ENOUGH:.0%}")
    return int(share < ENOUGH)


if __name__ == "__main__":
    sys.exit(main())
