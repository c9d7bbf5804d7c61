"""An option as one field of a dataclass: its metadata describe the option in one place.

The checks of a value (range, choices, condition), the flags of the command line and the messages all read the
same ``Spec``. So an option is added with one field.
"""

import dataclasses
import difflib
import functools
from collections.abc import Callable, Mapping
from dataclasses import field
from numbers import Real
from typing import Any, TypeAlias, get_args, get_type_hints

from circparam.core.records import dataclass
from circparam.core.registry import unknown_name
from circparam.errors import OptionError

LONGEST_VALUE = 80  # characters of a value that a message repeats
KEY = "option"  # under which the metadata of a field hold its Spec

# (all options, name of the field) → why it has no effect beside the others; None if it has one
Condition: TypeAlias = Callable[[Any, str], str | None]


@dataclass(frozen=True)
class Range:
    """The values of a number, both ends included; ``meaning`` gives its kind and unit.

    whole: whether only whole numbers are values.
    """

    low: float
    high: float
    meaning: str
    whole: bool = False

    def __contains__(self, value: object) -> bool:
        if isinstance(value, bool) or not isinstance(value, Real):
            return False
        return self.low <= float(value) <= self.high

    def check(self, name: str, value: object) -> None:
        """Raise OptionError if a value is not a number of the range; ``name`` as the user wrote it."""
        if value not in self:
            raise OptionError(f"{name} {shown(value)}: give {self.meaning}")
        if self.whole and value != int(value):  # type: ignore[call-overload]
            raise OptionError(f"{name} {value!r}: give a whole number")


@dataclass(frozen=True)
class Spec:
    """The description of one option.

    stage: its group in the help text. help: one line. flag: its spelling on the command
    line, ``--on/--off`` for a pair; empty for that of the field's name, and ``--no-NAME`` switches a field
    off. short: one letter. metavar: the name of its value. shown: the default as the help shows it, None
    for none. choices: all values, or ``names``: a function that gives them, called when
    they are needed. bounds: of a number; word: a word instead of a number; words: names of numbers.
    applies: see ``Condition``.
    """

    stage: str
    help: str
    flag: str = ""
    short: str = ""
    metavar: str | None = None
    shown: str | None = None
    choices: tuple[str, ...] = ()
    names: Callable[[], list[str]] | None = None
    bounds: Range | None = None
    word: str = ""
    words: Mapping[str, float] = field(default_factory=dict)
    applies: Condition | None = None

    @property
    def switches_off(self) -> bool:
        """Whether the flag means False."""
        return self.flag.startswith("--no-")

    @property
    def text(self) -> str:
        """The help text with the default."""
        return self.help if self.shown is None else f"{self.help}  [default: {self.shown}]"


def option(stage: str, help: str, *, default: Any = None, **known: Any) -> Any:
    """A field of a dataclass that is an option; ``known``: the other fields of ``Spec``."""
    return dataclasses.field(default=default, metadata={KEY: Spec(stage, help, **known)})


def specs(options: Any) -> dict[str, Spec]:
    """Name of the field → Spec, for every option of a dataclass or of an instance, in their order."""
    return {f.name: f.metadata[KEY] for f in dataclasses.fields(options) if KEY in f.metadata}


def flag(name: str, spec: Spec) -> str:
    """The spelling of an option on the command line, for messages."""
    return spec.flag.split("/")[0] or "--" + name.replace("_", "-")


@functools.cache
def types_of(options: Any) -> dict[str, frozenset[Any]]:
    """Name of the field → the types that it may hold, for every field of a dataclass."""
    hints = get_type_hints(options)
    return {f.name: frozenset(get_args(hints[f.name]) or {hints[f.name]})
            for f in dataclasses.fields(options)}  # fmt: skip


def shown(value: object) -> str:
    """A value that was given, in one short line: arrays and other containers by their shape or length."""
    if (shape := getattr(value, "shape", None)) is not None and shape != ():
        return f"(an array of shape {shape})"
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"


def check(options: Any) -> None:
    """Check every option of an instance, None meaning "not given": its field takes the default.

    Raises OptionError, in one line, for a value out of its range or none of its choices. An option without an
    effect beside the others raises it too. A count given as a float, such as 512.0, becomes an integer.
    """
    fields = {f.name: f for f in dataclasses.fields(options)}
    types = types_of(options.__class__)
    for name, spec in specs(options).items():
        value = getattr(options, name)
        if value is None:
            object.__setattr__(options, name, fields[name].default)
            continue
        if spec.words and isinstance(value, str):
            if value not in spec.words:  # without a near word the shortest is suggested
                near = difflib.get_close_matches(value, spec.words, n=1, cutoff=0.5)
                meaning = "" if spec.bounds is None else f"give {spec.bounds.meaning}; "
                meant = (near or list(spec.words))[0]
                said = f"{flag(name, spec)} {value!r}: {meaning}did you mean {meant}?"
                raise OptionError(said)
        elif spec.word and isinstance(value, str):
            if value != spec.word:
                raise OptionError(f"{flag(name, spec)} {value!r}: give {spec.word} or a number")
        elif spec.bounds is not None:
            whole = int in types[name] or spec.bounds.whole
            dataclasses.replace(spec.bounds, whole=whole).check(flag(name, spec), value)
            if int in types[name]:
                object.__setattr__(options, name, int(value))
        elif types[name] <= {bool, type(None)}:
            if isinstance(value, str) or value not in (True, False):  # any word would count as true
                raise OptionError(f"{flag(name, spec)} {shown(value)}: give True or False")
            object.__setattr__(options, name, bool(value))
        if spec.choices and not (isinstance(value, str) and value in spec.choices):
            choices = ", ".join(spec.choices)
            raise OptionError(f"unknown {flag(name, spec)} {shown(value)}: choose one of {choices}")
        names = spec.names() if spec.names is not None else None
        if names is not None and not (isinstance(value, str) and value in names):
            raise OptionError(unknown_name(name, str(value), names))
    for name, spec in specs(options).items():
        if spec.applies is None or getattr(options, name) is None:
            continue
        why = spec.applies(options, name)
        if why is not None:
            raise OptionError(f"{flag(name, spec)} has no effect here: {why}; leave it out")
