"""Errors in the words of Python: messages name options as the command line spells them, a caller does not.

A caller of a function knows ``max_distortion=0.5``, a user of the command line ``--max-distortion 0.5``.
Messages are written once, with flags; this module turns flags into keywords.
"""

import functools
import re
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from circparam.core.fields import Spec, flag, specs
from circparam.errors import CircparamError
from circparam.pipeline.options import ALIASES, Options

P = ParamSpec("P")
T = TypeVar("T")

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
        spellings = [flag(name, spec), *spec.flag.split("/"), "--" + name.replace("_", "-")]
        out |= {spelling: (name, spec) for spelling in spellings if " " not in spelling}
    return out | {
        "--" + old.replace("_", "-"): (name, known[name]) for old, name in ALIASES.items()
    }


def in_python(message: str) -> str:
    """A message with keywords where it names flags: ``--cut none`` becomes ``cut='none'``."""
    return FLAG.sub(_keyword, message)


def _keyword(found: re.Match[str]) -> str:
    spelling, value = found.group(1), found.group(2)
    if spelling not in _flags():
        return found.group(0)
    name, spec = _flags()[spelling]
    rest = "" if value is None else f" {value}"
    if spec.flag.endswith("/" + spelling) or (spelling.startswith("--no-") and spec.switches_off):
        return f"{name}=False{rest}"
    if value == "FILE":
        return f"{name}=..."
    if value is not None and (value[0] in "'+-.0123456789"):
        return f"{name}={value}"
    words = {*spec.choices, *(spec.names() if spec.names else ())}
    if value in words:
        return f"{name}={value!r}"
    switch = "bool" in str(Options.__annotations__[name])
    return f"{name}=True{rest}" if switch else name + rest


def python_words(function: Callable[P, T]) -> Callable[P, T]:
    """A public function whose errors name keywords instead of flags; class and cause stay.

    Its place is the package, so that it can be pickled: ``pool.map(circparam.unwrap, files)``.
    """
    if function.__module__ == "circparam":
        return function

    @functools.wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except CircparamError as error:
            said = in_python(str(error))
            if said == str(error):
                raise
            raise type(error)(said).with_traceback(error.__traceback__) from error.__cause__

    wrapped.__module__ = "circparam"
    return wrapped
