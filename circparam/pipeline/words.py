"""Errors in the words of Python: messages name options as the command line spells them, a caller does not.

A caller of a function knows ``max_distortion=0.5``, a user of the command line ``--max-distortion 0.5``.
Messages are written once, with flags; this module turns flags into keywords.
"""

import functools
import inspect
import re
from collections.abc import Callable, Mapping
from typing import ParamSpec, TypeAlias, TypeVar

from circparam.core.fields import Spec, specs, types_of
from circparam.errors import CircparamError
from circparam.pipeline.options import ALIASES, Options

P = ParamSpec("P")
T = TypeVar("T")
# flag → its keyword and the words that it takes as values
Names: TypeAlias = Mapping[str, tuple[str, tuple[str, ...]]]

# a flag that stands alone, and a possible value behind it: a number or a word in quotes
FLAG = re.compile(
    r"(?<![\w-])(--[a-z][a-z-]*[a-z])(?: ('[^']*'|[-+]?\d[\w.+-]*[\w]|[-+]?\d|[a-z-]+|FILE))?"
)


@functools.cache
def _flags() -> dict[str, tuple[str, Spec]]:
    """Every spelling of an option on the command line → (name of the keyword, its specification)."""
    known = specs(Options)
    out: dict[str, tuple[str, Spec]] = {}
    for name, spec in known.items():
        # --boundary polygon is a value of --boundary, and the corners have no flag of their own
        spellings = [*spec.flag.split("/"), "--" + name.replace("_", "-")]
        out |= {spelling: (name, spec) for spelling in spellings if " " not in spelling}
    return out | {
        "--" + old.replace("_", "-"): (name, known[name]) for old, name in ALIASES.items()
    }


def in_python(message: str, names: Names | None = None) -> str:
    """A message with keywords where it names flags: ``--cut none`` becomes ``cut='none'``.

    names: flags that are no options of an unwrap, or mean another keyword.
    """
    return FLAG.sub(lambda found: _keyword(found, names or {}), message)


def _keyword(found: re.Match[str], names: Names) -> str:
    spelling, value = found.group(1), found.group(2)
    rest = "" if value is None else f" {value}"
    words: set[str]
    if spelling in names:
        name, words, switch = names[spelling][0], set(names[spelling][1]), False
    elif spelling in _flags():
        name, spec = _flags()[spelling]
        off = spelling.startswith("--no-") and spec.switches_off
        if off or spec.flag.endswith("/" + spelling):
            return f"{name}=False{rest}"
        words = {*spec.choices, *(spec.names() if spec.names else ())}
        switch = bool in types_of(Options)[name]
    else:
        return found.group(0)
    if value == "FILE":
        return f"{name}=..."
    if value is not None and (value[0] in "'+-.0123456789"):
        return f"{name}={value}"
    if value in words:
        return f"{name}={value!r}"
    return f"{name}=True{rest}" if switch else name + rest


def python_words(function: Callable[P, T], names: Names | None = None) -> Callable[P, T]:
    """A public function whose errors name keywords instead of flags; class and cause stay.

    names: flags that stand for other keywords than those of their names. The function's place is the package,
    so that it can be pickled: ``pool.map(circparam.unwrap, files)``.
    """
    if function.__module__ == "circparam":
        return function
    own = {
        "--" + name.replace("_", "-"): (name, ())
        for name in inspect.signature(function).parameters
        if name not in specs(Options)
    }
    known: Names = {**own, **(names or {})}

    @functools.wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except CircparamError as error:
            said = in_python(str(error), known)
            if said == str(error):
                raise
            raise type(error)(said).with_traceback(error.__traceback__) from error.__cause__

    wrapped.__module__ = "circparam"
    return wrapped
