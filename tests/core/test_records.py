"""Classes of ``core.records`` behave as those of the standard library: each test holds for both decorators."""

import copy
import dataclasses
import pickle
from dataclasses import field
from typing import Any, ClassVar

import pytest

from circparam.core import records

pytestmark = pytest.mark.parametrize(
    "dataclass", [dataclasses.dataclass, records.dataclass], ids=["standard", "ours"]
)


def _classes(dataclass: Any) -> tuple[Any, Any]:
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

    return Base, Child


@records.dataclass(frozen=True, eq=False)
class Kept:
    x: int
    y: int = 3


def test_values_by_place_name_and_default(dataclass: Any) -> None:
    _, Child = _classes(dataclass)
    one, two = Child(1, e=5), Child(1, [4], 3.0, "x", e=6)
    assert (one.a, one.b, one.c, one.d, one.e) == (1, [], 2.0, "d", 5)
    assert (one.length, one.kind) == (7, "base")
    assert (two.b, two.c, two.d) == ([4], 3.0, "x")
    assert Child(1, e=5).b is not one.b
    for values, named in (
        ((), {"e": 1}), ((1,), {}), ((1, [], 2.0, "d", 9), {}), ((1,), {"e": 1, "f": 2}),
    ):  # fmt: skip
        for made in (Child, _classes(dataclass)[1]):  # after the first instance, and before
            with pytest.raises(TypeError, match="__init__"):
                made(*values, **named)


def test_frozen_is_frozen_and_replaced_by_copies(dataclass: Any) -> None:
    Base, Child = _classes(dataclass)
    for one in (Base(1), Child(1, e=2)):
        with pytest.raises(dataclasses.FrozenInstanceError):
            one.a = 2
        with pytest.raises(dataclasses.FrozenInstanceError):
            del one.a
        assert dataclasses.replace(one, a=4).a == 4
        assert one.a == 1
    with pytest.raises(ValueError, match="below zero"):
        dataclasses.replace(Child(1, e=2), e=-1)
    assert dataclasses.asdict(Base(1, [2])) == {"a": 1, "b": [2], "c": 2.0, "length": 7}
    assert copy.deepcopy(Base(1, [2])).b == [2]
    sent = pickle.loads(pickle.dumps(Kept(4)))
    assert (sent.x, sent.y) == (4, 3)


def test_a_standard_class_inherits(dataclass: Any) -> None:
    Base, _ = _classes(dataclass)

    @dataclasses.dataclass(frozen=True)
    class Last(Base):
        d: int = 4

    one = Last(1, d=5)
    assert (one.a, one.b, one.d) == (1, [], 5)
    assert one == Last(1, d=5) != Last(1)
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.a = 2
    with pytest.raises(TypeError, match="non-frozen"):

        @dataclass
        class Loose(Base):
            d: int = 4


def test_equality_hash_and_text(dataclass: Any) -> None:
    Base, Child = _classes(dataclass)

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

    class_of_two = dataclasses.make_dataclass("Two", ["x"], frozen=True)
    assert Child(1, d="a", e=2) == Child(1, d="b", e=2) != Base(1) != class_of_two(1)
    tuples = [Child(1, (), e=2), Child(1, (), d="b", e=2), Child(1, (), e=3)]
    assert len(set(tuples)) == 2
    assert repr(Base(1)).endswith("Base(a=1, c=2.0, length=7)")
    one = Mutable(1)
    one.x = 5
    assert one == Mutable(5)
    with pytest.raises(TypeError, match="unhashable"):
        hash(one)
    assert Kept(1) != Kept(1)
    assert hash(Kept(1)) is not None
    assert (repr(Own(1)), hash(Own(1)), Own(1) == Own(2)) == ("own", 3, True)
