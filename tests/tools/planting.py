"""Which faults are planted: a sample of places, the same as long as their lines stay as they are."""

from __future__ import annotations

import ast
import difflib
import hashlib
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

from tests.bench.common import ROOT

_ARITHMETIC = "Add|Sub|Mul|Div|FloorDiv"
_BITS = "BitAnd|BitOr|BitXor"
_ORDER = "Eq|NotEq|Lt|LtE|Gt|GtE"
# A minus that becomes a shift, or a < that becomes an ``is``, is noticed by whatever runs it: a sample of
# those says nothing of the tests. So operators change within their kind.
KINDS = [
    rf"ReplaceBinaryOperator_({_ARITHMETIC})_({_ARITHMETIC})",
    rf"ReplaceBinaryOperator_({_BITS})_({_BITS})",
    r"ReplaceBinaryOperator_(Mod|Pow)_(Mul|Div)",
    rf"ReplaceComparisonOperator_({_ORDER})_({_ORDER})",
    r"ReplaceComparisonOperator_(Is_IsNot|IsNot_Is)",
    r"ReplaceUnaryOperator_(Delete_.*|USub_UAdd)",
    r"AddNot|Replace(True|False)With\w+|Replace(And|Or)With\w+|Replace(Break|Continue)With\w+",
    r"NumberReplacer|ZeroIterationForLoop",
]


@dataclass(frozen=True)
class Mutant:
    """One change. file: from the root of the tree. line: from 1. before, after: the lines it changes."""

    file: str
    line: int
    before: str
    after: str
    source: str

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is recognised by when lines have moved."""
        return self.file, self.before, self.after


def silent_ranges(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Stretches of code, as ((line, column), (line, column)), in which a change cannot or need not show.

    Annotations are never evaluated, blocks under TYPE_CHECKING never run; texts are for people; decorators say
    how a class may be used; a constant in capitals is a measured choice, next to which others are as right.
    """
    lines = source.splitlines()

    def place(line: int, offset: int) -> tuple[int, int]:
        return line, len(lines[line - 1].encode()[:offset].decode())

    def is_quiet(node: ast.AST) -> bool:
        if isinstance(node, ast.JoinedStr):
            return True
        return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)

    tree = ast.parse(source)
    quiet: list[Any] = [node for node in ast.walk(tree) if is_quiet(node)]
    for node in ast.walk(tree):
        quiet += [getattr(node, "annotation", None), getattr(node, "returns", None)]
        quiet += getattr(node, "decorator_list", [])
        if isinstance(node, ast.Call):
            # zip(strict=True) guards against what does not happen; to NumPy every negative size is -1
            quiet += [k.value for k in node.keywords if k.arg == "strict"]
            if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
                quiet += [a for a in node.args if isinstance(a, ast.UnaryOp)]
    for node in tree.body:
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        if all(isinstance(t, ast.Name) and t.id.isupper() for t in targets):
            quiet.append(node)
    spots = [n for n in quiet if n is not None]
    ends = [(n.lineno, n.col_offset, n.end_lineno, n.end_col_offset) for n in spots]
    return [(place(a, b), place(c, d)) for a, b, c, d in ends]


def _rank(*parts: object) -> bytes:
    """A number by which to choose, the same on every machine and whatever else is in the tree."""
    return hashlib.sha256("\0".join(map(str, parts)).encode()).digest()


def places(name: str, operators: dict[str, Any]) -> Iterator[tuple[tuple[Any, ...], list[Any]]]:
    """Places of a file that can be mutated: (what names the place, [(operator, occurrence)])."""
    source = (ROOT / name).read_text(encoding="utf-8")
    lines, quiet = source.splitlines(), silent_ranges(source)
    count: Counter[str] = Counter()
    found: dict[tuple[int, int], list[tuple[str, int]]] = defaultdict(list)
    for node in ast_nodes(get_ast(source)):
        for operator, made in operators.items():
            for start, _ in made.mutation_positions(node):
                if not any(a <= start < b for a, b in quiet):
                    found[start].append((operator, count[operator]))
                count[operator] += 1
    same: Counter[str] = Counter()
    for (line, column), ways in sorted(found.items()):
        text = lines[line - 1].strip()
        same[text] += 1
        yield (name, text, column, same[text]), ways


def sample(names: list[str], size: int, seed: int) -> list[Mutant]:
    """So many mutants, one a place: the same places as long as their lines stay as they are."""
    wanted = [re.compile(f"core/({kind})$") for kind in KINDS]
    operators = {
        n: get_operator(n)() for n in operator_names() if any(kind.match(n) for kind in wanted)
    }
    found = [
        (_rank(seed, *where), where, ways) for n in names for where, ways in places(n, operators)
    ]
    chosen: list[Mutant] = []
    for _, (name, *where), ways in sorted(found, key=lambda f: f[0]):
        if len(chosen) == size:
            break
        for operator, occurrence in sorted(ways, key=lambda w: _rank(seed, name, *where, *w[:1])):
            mutant = planted(name, operators[operator], occurrence)
            if mutant is not None:
                chosen.append(mutant)
                break
    return chosen


def planted(name: str, operator: Any, occurrence: int) -> Mutant | None:
    """The mutant that an operator makes; None where that is no Python or changes nothing."""
    source = (ROOT / name).read_text(encoding="utf-8")
    changed = mutate_code(source, operator, occurrence)
    if changed is None:
        return None
    try:
        if ast.dump(ast.parse(changed)) == ast.dump(ast.parse(source)):
            return None
    except SyntaxError:
        return None
    old, new = source.splitlines(), changed.splitlines()
    blocks = [
        b for b in difflib.SequenceMatcher(None, old, new, False).get_opcodes() if b[0] != "equal"
    ]
    before = " ".join(line.strip() for _, a, b, _, _ in blocks for line in old[a:b])
    after = " ".join(line.strip() for _, _, _, a, b in blocks for line in new[a:b])
    return Mutant(name, blocks[0][1] + 1, before, after, changed)
