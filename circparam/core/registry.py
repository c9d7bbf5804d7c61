"""A family of interchangeable functions is one table: name → function, summary, citation, guarantees.

The choices of the command line, ``circparam methods``, the contract tests and the did-you-mean errors all read
the same rows. Nothing is kept in sync by hand.
"""

import difflib
from collections.abc import Callable, Iterator
from dataclasses import field
from typing import Generic, TypeVar

from circparam.core.records import dataclass
from circparam.errors import OptionError

F = TypeVar("F", bound=Callable[..., object])

# The promises of a row. One parametrised test in tests/contracts proves every tag.
TAGS = {
    "positive": "weights are positive for every triangle mesh",
    "reproduces-plane": "a planar mesh comes back as it was, up to a similarity",
    "flip-free": "no face is flipped (positive weights and a convex boundary, or a flip-free step)",
    "free-boundary": "the boundary is part of the unknowns",
    "convex-boundary": "the boundary lies on a convex polygon",
}


@dataclass(frozen=True)
class Row(Generic[F]):
    """One entry of a table.

    summary: one line for help texts. citation: author, year, equation. tags: keys of ``TAGS``.
    condition: the condition of the guarantee, in one sentence (empty if there is none).
    accepts: names of the options that the user may give with this entry; all others have no effect on it.
    """

    name: str
    function: F
    summary: str
    citation: str = ""
    tags: frozenset[str] = field(default_factory=frozenset)
    condition: str = ""
    accepts: frozenset[str] = field(default_factory=frozenset)

    def __post_init__(self) -> None:
        unknown = self.tags - set(TAGS)
        if unknown:
            raise ValueError(f"unknown tags {sorted(unknown)} in row {self.name!r}")


class Table(Generic[F]):
    """Rows by name, in the order in which they are shown. ``kind`` names the family in messages."""

    def __init__(self, kind: str, *rows: Row[F]) -> None:
        self.kind = kind
        self._rows = {row.name: row for row in rows}

    def __iter__(self) -> Iterator[Row[F]]:
        return iter(self._rows.values())

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    def __getitem__(self, name: str) -> Row[F]:
        """The row of that name; raises OptionError with the nearest names otherwise."""
        if name not in self._rows:
            raise OptionError(unknown_name(self.kind, name, self.names()))
        return self._rows[name]

    def names(self) -> list[str]:
        """All names, in the order of the table."""
        return list(self._rows)

    def tagged(self, tag: str) -> list[str]:
        """Names of the rows that carry a tag."""
        return [row.name for row in self if tag in row.tags]


def unknown_name(kind: str, name: str, names: list[str]) -> str:
    """The message for an unknown name: did-you-mean, or the list of names."""
    cure = did_you_mean(name, names, f"choose one of {', '.join(names)}")
    return f"unknown {kind} {name!r}: {cure}"


def did_you_mean(name: str, names: list[str], otherwise: str) -> str:
    """The nearest names as a question, or the other cure where none is near."""
    near = difflib.get_close_matches(name, names, n=2, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else otherwise
