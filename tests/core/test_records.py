"""Classes of ``core.records`` do whatever those of the standard library do, errors and their words included."""

import copy
import dataclasses
import pickle
from collections.abc import Callable
from dataclasses import asdict, field, replace
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from circparam.core import records


@records.dataclass(frozen=True, eq=False)
class Kept:
    x: int
    y: int = 3


def classes(dataclass: Any) -> SimpleNamespace:
    """Classes of every kind by one of both decorators; Last is of the standard library and inherits."""

    @dataclass(frozen=True)
    class Base:
        a: int
        b: list[int] = field(default_factory=list, repr=False)
        c: float = 2.0
        kind: ClassVar[str] = "base"
        length: int = field(init=False, default=7)

    @dataclass(frozen=True)
    class Child(Base):
        d: str = field(default="d", compare=False)
        e: int = field(kw_only=True)

        def __post_init__(self) -> None:
            if self.e < 0:
                raise ValueError("below zero")

    @dataclasses.dataclass(frozen=True)
    class Last(Base):
        d: int = 4

    @dataclass
    class Mutable:
        x: int

    @dataclass(frozen=True)
    class Own:
        x: int

        def __repr__(self) -> str:
            return "own"

        def __eq__(self, other: object) -> bool:
            return True

        def __hash__(self) -> int:
            return 3

    @dataclass(frozen=True, eq=False)
    class Itself:
        x: int

    def loose() -> Any:
        return dataclass(type("Loose", (Base,), {"__annotations__": {"d": int}, "d": 4}))

    return SimpleNamespace(**locals())


OPERATIONS: dict[str, Callable[[Any], Any]] = {
    "defaults": lambda c: (vars(c.Child(1, e=5)), c.Child.length, c.Child.kind),
    "values by place": lambda c: vars(c.Child(1, [4], 3.0, "x", e=6)),
    "a default made anew": lambda c: c.Child(1, e=5).b is c.Child(1, e=5).b,
    "no value": lambda c: c.Child(e=1),
    "no value by name": lambda c: c.Child(1),
    "a value too many": lambda c: c.Child(1, [], 2.0, "d", 9),
    "an unknown name": lambda c: c.Child(1, e=1, f=2),
    "setting": lambda c: setattr(c.Base(1), "a", 2),
    "setting in a child": lambda c: setattr(c.Child(1, e=2), "a", 2),
    "setting in the last": lambda c: setattr(c.Last(1), "a", 2),
    "deleting": lambda c: delattr(c.Child(1, e=2), "a"),
    "replacing": lambda c: vars(replace(c.Child(1, e=2), a=4)),
    "replacing by what is refused": lambda c: replace(c.Child(1, e=2), e=-1),
    "a dictionary": lambda c: asdict(c.Base(1, [2])),
    "a copy": lambda c: vars(copy.deepcopy(c.Base(1, [2]))),
    "values of the last": lambda c: vars(c.Last(1, d=5)),
    "a child that is not frozen": lambda c: c.loose(),
    "changing": lambda c: setattr(c.Mutable(1), "x", 5),
    "a hash of what changes": lambda c: hash(c.Mutable(1)),
    "texts": lambda c: [repr(x) for x in (c.Base(1), c.Last(1), c.Mutable(2), c.Own(1))],
    "methods of its own": lambda c: (hash(c.Own(1)), c.Own(1) == c.Own(2)),
    "equal": lambda c: c.Child(1, d="a", e=2) == c.Child(1, d="b", e=2),
    "equal in no child": lambda c: (c.Child(1, e=2) == c.Base(1), c.Base(1) == c.Last(1)),
    "equal to nothing else": lambda c: [c.Base(1) == x for x in (c.Base(0), c.Base(2), c.Own(1))],
    "equal to itself alone": lambda c: c.Itself(1) == c.Itself(1),
    "one of a set": lambda c: len({c.Child(1, (), d=d, e=e) for d in "ab" for e in (2, 3)}),
    "one of a set by itself": lambda c: len({c.Itself(1), c.Itself(1)}),
}


def outcome(operation: Callable[[Any], Any], own: Any) -> Any:
    """What an operation returns, or the error that it raises."""
    try:
        return operation(own)
    except (TypeError, ValueError, AttributeError) as error:
        return type(error), str(error)


@pytest.mark.parametrize("name", OPERATIONS)
def test_both_do_the_same(name: str) -> None:
    """For the first instance, before which nothing is compiled, and for the second."""
    ours, standard = classes(records.dataclass), classes(dataclasses.dataclass)
    for _ in range(2):
        assert outcome(OPERATIONS[name], ours) == outcome(OPERATIONS[name], standard)


def test_instances_are_sent_to_other_processes() -> None:
    sent = pickle.loads(pickle.dumps(Kept(4)))
    assert (sent.x, sent.y) == (4, 3)
