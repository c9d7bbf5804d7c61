"""``make bench-hand``: density by what a face is, groups, upright charts."""

import tempfile
from pathlib import Path
from typing import Any

import circparam
from circparam import samples
from circparam.pipeline.summary import summarise
from tests.bench.common import Line
from tests.support.assembly import assemble, kinds, write_parts


def named(folder: str) -> Path:
    """60 parts of 12 kinds and three materials, as an OBJ."""
    path = Path(folder) / "parts.obj"
    write_parts(path, assemble(kinds(12), 60, seed=3))
    return path


def densities() -> list[Line]:
    """What three materials ask for and get, on one page, in boxes and on pages of their own."""
    lines = []
    ways: dict[str, dict[str, Any]] = {
        "one page": {},
        "--group-by material": {"group_by": "material"},
        "--pages-by material": {"pages_by": "material"},
    }
    for name, words in ways.items():
        with tempfile.TemporaryDirectory() as folder:
            asked = "body=2,bolts=0.5"
            result = circparam.unwrap(named(folder), density=asked, jobs=1, **words)
        rows = summarise(result)["density"]
        worst = max(abs(row["got"] / row["asked"] - 1) for row in rows)
        lines += [
            Line(f"{name}: density got over that asked, farthest from 1", 100 * worst, "%", "<= 2"),
            Line(f"{name}: covered", 100 * float(result.measures["pack"] or 0), "%"),
        ]
    return lines


def upright() -> list[Line]:
    """What it costs to turn charts upright."""
    lines = []
    for name in ("creature", "bracket", "knot"):
        path = samples.path(name)
        free = circparam.unwrap(path, jobs=1)
        for words in ({"orient": "up"}, {"orient": "up", "rotate": "90"}):
            up = circparam.unwrap(path, jobs=1, **words)
            ratio = float(up.measures["pack"] or 0) / float(free.measures["pack"] or 1)
            said = " ".join(f"--{k} {v}" for k, v in words.items())
            lines.append(Line(f"{name}, {said}: cover over that of free rotation", ratio))
    return lines
