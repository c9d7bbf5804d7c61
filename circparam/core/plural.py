"""Words of messages: numbers with their nouns or units."""

from collections.abc import Sequence

_PLURALS = {
    "vertex": "vertices",
    "mesh": "meshes",
    "copy": "copies",
    "boundary": "boundaries",
    "is": "are",
    "has": "have",
}


def counted(number: int, noun: str) -> str:
    """``1 vertex``, ``2 vertices``, ``1,234 faces``; adjectives before the noun stay as they are."""
    return f"{number:,} {plural(number, noun)}"


def plural(number: int, noun: str) -> str:
    """The noun, or the verb, as it stands with a number: the last word decides."""
    if number == 1:
        return noun
    head, blank, last = noun.rpartition(" ")
    return f"{head}{blank}{_PLURALS.get(last, last + 's')}"


def percent(share: float) -> str:
    """``0.15 %``, ``2.3 %``, ``98 %``: two digits, all that stand before the point."""
    value = 100 * share
    return f"{value:.0f} %" if abs(value) >= 9.95 else f"{value:.2g} %"


def listed(names: Sequence[str], most: int = 3) -> str:
    """``a``, ``a and b``, ``a, b and c``; of more than ``most`` the first and how many more."""
    shown = list(names)
    if len(shown) > most:
        shown = [*shown[: most - 1], f"{len(names) - most + 1} more"]
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)
