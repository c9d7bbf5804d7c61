"""``make fuzz``: many cases, counted; prints the seed, and keeps the files of the cases that went wrong.

python -m tests.fuzz --cases 5000 --seed 0 --minutes 30
"""

import argparse
import collections
import shutil
import sys
import tempfile
import time
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

from tests.fuzz.cases import Case, cases
from tests.fuzz.check import problems


def main() -> int:
    """Run; 0 where every case went as it should."""
    parser = argparse.ArgumentParser(description="Fuzz the command line.")
    parser.add_argument("--cases", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    late = "start no further case after this time"
    parser.add_argument("--minutes", type=float, default=30.0, help=late)
    parser.add_argument("--bound", type=float, default=20.0, help="seconds for one case")
    parser.add_argument("--keep", type=Path, help="folder for the files of cases that went wrong")
    chosen = parser.parse_args()
    keep = chosen.keep or Path(tempfile.mkdtemp(prefix="circparam-fuzz-"))
    keep.mkdir(parents=True, exist_ok=True)
    end = time.monotonic() + 60 * chosen.minutes
    wrong: list[tuple[Case, list[str]]] = []
    count: collections.Counter[str] = collections.Counter()
    endings: collections.Counter[str] = collections.Counter()
    slowest = 0.0

    @seed(chosen.seed)
    @settings(
        max_examples=chosen.cases, deadline=None, database=None, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(cases())
    def one(case: Case) -> None:
        nonlocal slowest
        if time.monotonic() > end:
            count["skipped"] += 1
            return
        with tempfile.TemporaryDirectory() as name:
            start = time.monotonic()
            found = problems(case, Path(name), chosen.bound, endings)
            slowest = max(slowest, time.monotonic() - start)
        count["run"] += 1
        count[case.command[0]] += 1
        if found:
            wrong.append((case, found))
            (keep / f"{case.key}-{case.name}").write_bytes(case.data)
            words = [*case.command, f"{case.key}-{case.name}", *case.options, str(case.output)]
            print(f"{' '.join(words)}: {'; '.join(found)}", flush=True)

    bounds = f"seed {chosen.seed}, at most {chosen.minutes:g} minutes"
    print(f"fuzz: {chosen.cases} cases, {bounds}", flush=True)
    one()
    skipped = f", {count['skipped']} not run for lack of time" if count["skipped"] else ""
    print(
        f"fuzz: {count['run']} cases (unwrap {count['unwrap']}, check {count['check']}), seed {chosen.seed}: "
        f"{len(wrong)} wrong, slowest {slowest:.1f} s{skipped}"
    )
    print("fuzz: " + ", ".join(f"{n} {how}" for how, n in endings.most_common()))
    if wrong:
        print(f"fuzz: files of the wrong cases are in {keep}")
    elif chosen.keep is None:
        shutil.rmtree(keep, ignore_errors=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
