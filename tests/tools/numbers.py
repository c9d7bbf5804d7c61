"""The numbers that steer seams and pages, by module: ``python -m tests.tools.numbers [--each]``.

A number steers where it stands in a constant of a module, in a field of a class or in a default of a parameter,
and a change of it may lead to other seams or another page. Not counted: 0, ±1, ½ and 2, which no measurement
sets; tolerances below a millionth, which precision sets; and masks and multipliers of hashes.
"""

import argparse
import ast
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "circparam"
# what decides where seams run and how charts lie on a page
PIPELINE = ("cut_along", "fuller_page", "page_cuts", "page_search", "place", "searches")
STEERING = ["seams", "packing", *(f"pipeline/{name}.py" for name in PIPELINE)]
FREE = (0, 1, 0.5, 2)
PRECISION = 1e-6
HASH = 1 << 32


def modules() -> list[Path]:
    """The files that are counted."""
    places = [PACKAGE / name for name in STEERING]
    return sorted(
        p for place in places for p in ([place] if place.is_file() else place.rglob("*.py"))
    )


def steers(value: object) -> bool:
    """Whether a literal is a number that a measurement has to justify."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) not in FREE and PRECISION < abs(value) < HASH


def settings(tree: ast.Module) -> Iterator[ast.expr]:
    """What constants, fields and parameters are set to."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef)):
            for inner in node.body:
                if isinstance(inner, (ast.Assign, ast.AnnAssign)) and inner.value is not None:
                    yield inner.value
        elif isinstance(node, ast.arguments):
            yield from node.defaults
            yield from (default for default in node.kw_defaults if default is not None)


def numbers(path: Path) -> list[tuple[int, float]]:
    """(line, value) of each number of a module that steers."""
    return sorted(
        (node.lineno, float(node.value))
        for setting in settings(ast.parse(path.read_text("utf-8")))
        for node in ast.walk(setting)
        if isinstance(node, ast.Constant) and steers(node.value)
    )


def count() -> int:
    """How many numbers steer seams and pages."""
    return sum(len(numbers(path)) for path in modules())


def main() -> None:
    """Print the count of each module, with ``--each`` every number."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", action="store_true")
    each = parser.parse_args().each
    for path in modules():
        found = numbers(path)
        if found:
            print(f"{len(found):4d}  {path.relative_to(PACKAGE)}")
        if each:
            print("".join(f"        {line}: {value:g}\n" for line, value in found), end="")
    print(f"{count():4d}")


if __name__ == "__main__":
    main()
