"""Names of rows: the methods of the library, and the baselines."""

from collections.abc import Sequence

from circparam.compare.baselines import BASELINES, require
from circparam.core.registry import unknown_name
from circparam.errors import OptionError
from circparam.methods import METHODS


def method_names(text: str | Sequence[str]) -> list[str]:
    """Names as a list: ``"circle,floater"``, ``"all"`` (every method of METHODS), or the names themselves.

    Raises OptionError for an unknown name (with the nearest ones), a name given twice, or a baseline that is
    not installed.
    """
    parts = text.split(",") if isinstance(text, str) else list(text)
    names: list[str] = []
    known = [*METHODS.names(), *BASELINES]
    for name in filter(None, (part.strip() for part in parts)):
        if name not in known and name != "all":
            raise OptionError(unknown_name("method", name, [*known, "all"]))
        names += METHODS.names() if name == "all" else [name]
    if not names:
        raise OptionError(f"--methods names no method: choose from {', '.join(known)}, all")
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    if twice:
        raise OptionError(f"--methods names {twice[0]} twice: name each method once")
    for name in names:
        if name in BASELINES:
            require(name)
    return names
