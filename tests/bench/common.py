"""What every benchmark shares: machine facts, lines with a wanted value, a report as Markdown."""

import argparse
import os
import platform
import subprocess
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[2]
REPORTS = ROOT / "docs" / "benchmarks"


@dataclass(frozen=True)
class Line:
    """One figure. wanted: a text such as "<= 40"; None where the figure only informs."""

    name: str
    value: float
    unit: str = ""
    wanted: str | None = None
    detail: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the figure is as wanted."""
        if self.wanted is None:
            return None
        sign, bound = self.wanted.split()
        return self.value <= float(bound) if sign == "<=" else self.value >= float(bound)

    @property
    def verdict(self) -> str:
        """One word for the report."""
        return {None: "", True: "met", False: "**missed**"}[self.met]

    def cells(self) -> list[str]:
        """The row of the report."""
        value = f"{self.value:.4g} {self.unit}".strip()
        return [self.name, value, self.wanted or "", self.verdict, self.detail]


def say(line: Line) -> None:
    """Print a figure as soon as it is there."""
    wanted = f"  wanted {line.wanted}: {line.verdict.strip('*')}" if line.wanted else ""
    detail = f"  ({line.detail})" if line.detail else ""
    print(f"{line.name}: {line.value:.4g} {line.unit}{wanted}{detail}", flush=True)


def machine() -> list[str]:
    """Facts without which a time means nothing."""
    cpu, known = platform.processor() or platform.machine(), Path("/proc/cpuinfo")
    for text in known.read_text().splitlines() if known.exists() else ():
        if text.startswith("model name"):
            cpu = text.split(":", 1)[1].strip()
            break
    memory = f"{psutil.virtual_memory().total / 2**30:.0f} GB"
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    names = ["numpy", "scipy", "libigl", "xatlas", "fast-simplification"]
    versions = []
    for name in names:
        try:
            versions.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            versions.append(f"no {name}")
    threads = os.environ.get("OMP_NUM_THREADS", "not set")
    return [
        f"- machine: {cpu}, {cores} cores, {memory}, {platform.system()}",
        f"- Python {platform.python_version()}, {', '.join(versions)}",
        f"- OMP_NUM_THREADS: {threads}; commit {commit()}",
    ]


def commit() -> str:
    """The short name of the commit, with a + where files differ from it."""
    words = ["git", "describe", "--always", "--dirty=+"]
    try:
        return subprocess.check_output(
            words, cwd=ROOT, text=True, stderr=subprocess.DEVNULL
        ).strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """A Markdown table."""
    head = list(head)
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def write(name: str, title: str, intro: str, blocks: Iterable[list[str]]) -> None:
    """Write a report into docs/benchmarks, and say so."""
    path = REPORTS / name
    parts = [f"# {title}", "", intro, "", *machine(), ""]
    for block in blocks:
        parts += [*block, ""]
    path.write_text("\n".join(parts).rstrip() + "\n", encoding="utf-8")
    print(f"written: {path}")


def figures(lines: Iterable[Line]) -> list[str]:
    """Lines as a Markdown table."""
    return table(["figure", "measured", "wanted", "", "detail"], (line.cells() for line in lines))


def children_seconds() -> float:
    """Processor seconds of all processes that this one has waited for."""
    return float(sum(os.times()[2:4]))


def options(text: str | None) -> argparse.ArgumentParser:
    """The command line of a benchmark, whose docstring tells what it does."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=text, formatter_class=form)
    parser.add_argument("--no-report", action="store_true", help="print only, write no page")
    return parser


def section(title: str, lines: Iterable[str]) -> list[str]:
    """A block of a report under a heading of its own."""
    return [f"## {title}", "", *lines]


def wanted(lines: list[Line], title: str = "Wanted and measured") -> list[str]:
    """The block of the figures that something is asked of; each is printed, too."""
    for line in lines:
        say(line)
    return section(title, figures(lines))


def run_cases(
    parser: argparse.ArgumentParser,
    *functions: Callable[[argparse.Namespace], list[Line]],
    page: Callable[[argparse.Namespace], tuple[str, str, str]],
) -> None:
    """Run the cases that the command line names, and write the page where all of them were run.

    A case is the name of a function of the command line, its docstring the heading. page: file, title, intro.
    """
    cases = {function.__name__: function for function in functions}
    names = ", ".join(cases)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of: {names}; all if left out")
    chosen = parser.parse_args()
    for name in chosen.cases:
        if name not in cases:
            parser.error(f"no case {name!r}: choose from {names}")
    print("\n".join(machine()), flush=True)
    blocks = []
    for name in chosen.cases or cases:
        title = str(cases[name].__doc__).splitlines()[0].rstrip(".")
        blocks.append(wanted(cases[name](chosen), title))
    if not chosen.no_report and not chosen.cases:
        write(*page(chosen), blocks)
