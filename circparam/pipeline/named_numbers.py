"""The words of ``--density``; importing this module loads no NumPy."""

import math
import os
from collections.abc import Mapping
from typing import Any

from circparam.errors import OptionError

EVEN, SOURCE = "even", "source"
GRAMMAR = "write even, source, NAME=X,NAME=X or the name of a file with one number a face"


def named_numbers(given: Any) -> dict[str, float] | None:
    """Names with densities from ``face=2,sole=0.5`` or a mapping; None for other values.

    A string without ``=``, and the name of a file that exists, are no list. Raises OptionError for a number
    that is not above 0 and finite, or a repeated name.
    """
    if isinstance(given, Mapping):
        pairs: list[tuple[str, Any]] = [(str(name), value) for name, value in given.items()]
    elif isinstance(given, str) and "=" in given and not os.path.exists(given):
        rows = [part.rpartition("=") for part in given.split(",")]
        for name, sign, value in rows:
            if not sign or not name.strip():
                raise OptionError(
                    f"--density {(name + sign + value).strip()!r} is not NAME=X: {GRAMMAR}"
                )
        pairs = [(name.strip(), value) for name, _, value in rows]
    else:
        return None
    if not pairs:
        raise OptionError(f"--density is empty: {GRAMMAR}")
    out: dict[str, float] = {}
    for name, value in pairs:
        if name in out:
            raise OptionError(f"--density names {name!r} twice: give one number")
        try:
            out[name] = float(value)
        except (TypeError, ValueError):
            out[name] = math.nan
        if not 0 < out[name] < math.inf:
            raise OptionError(
                f"--density {name}={str(value).strip()}: give a number above 0; parts that are not named "
                "have 1"
            )
    return out


def check_density_words(given: Any) -> None:
    """Raise OptionError for a density that no file can have."""
    if given is None or named_numbers(given) is not None:
        return
    if isinstance(given, str) and not given:
        raise OptionError(f"--density {given!r}: {GRAMMAR}")
