"""Ranges, the words of an option (tests/contracts/test_toy_option.py has the rest), numbers in messages."""

import math

import numpy as np
import pytest

from circparam.core.fields import Range, check, option, shown, types_of
from circparam.core.limits import check_page
from circparam.core.plural import counted, percent
from circparam.core.records import dataclass
from circparam.errors import OptionError
from circparam.pipeline.options import Options

ROOM = Range(1, 10, "a room from 1 to 10")


@pytest.mark.parametrize("value", [1, 10, 1.5, np.int64(3), np.float64(9.99), np.float32(2)])
def test_numbers_of_every_kind_are_numbers(value: object) -> None:
    assert value in ROOM
    ROOM.check("--room", value)


@pytest.mark.parametrize(
    "value", [0.999, 10.001, math.nan, math.inf, True, np.True_, "3", None, 3j]
)
def test_what_is_outside_or_no_number(value: object) -> None:
    assert value not in ROOM
    with pytest.raises(OptionError, match=r"^--room .*: give a room from 1 to 10$"):
        ROOM.check("--room", value)


def test_a_count_is_whole() -> None:
    rooms = Range(1, 10, "a room from 1 to 10", whole=True)
    rooms.check("--room", 3.0)
    with pytest.raises(OptionError, match=r"--room 1\.5: give a whole number"):
        rooms.check("--room", 1.5)


def test_types_are_those_of_the_fields() -> None:
    """A type that only holds the word int, such as Interval, was taken for a count."""
    found = types_of(Options)
    assert found["pages"] == {int, type(None)}
    assert found["padding"] == {int, str, type(None)}
    assert found["overwrite"] <= {bool, type(None)}


def test_a_switch_is_no_word() -> None:
    """``repair="no"`` repaired."""
    with pytest.raises(OptionError, match="--repair 'no': give True or False"):
        Options(repair="no")
    switched = Options(overwrite=1, repair=np.False_)
    assert (switched.overwrite, switched.repair) == (True, False)


@pytest.mark.parametrize("known", [{"choices": ("oak", "elm")}, {"names": lambda: ["oak", "elm"]}])
def test_only_the_words_of_an_option_are_taken(known: dict[str, object]) -> None:
    @dataclass
    class Tree:
        kind: str = option("plant", "a tree", default="oak", **known)

    check(Tree("elm"))
    for value in ("ash", 3):
        with pytest.raises(OptionError, match=rf"^unknown .*kind '?{value}"):
            check(Tree(value))


def test_values_in_messages_are_short_lines() -> None:
    assert shown(np.zeros((3, 2))) == "(an array of shape (3, 2))"
    assert shown("draft") == "'draft'"
    assert "\n" not in shown([np.zeros((3, 3))] * 9)
    assert len(shown(list(range(10**4)))) < 100


@pytest.mark.parametrize(("resolution", "padding"), [(1, 0), (3, 1), (64, 31), (65, 32)])
def test_a_page_with_room_for_a_texel(resolution: int, padding: int) -> None:
    check_page(resolution, padding)
    with pytest.raises(OptionError, match=f"--padding {padding} or less"):
        check_page(resolution, padding + 1)


@pytest.mark.parametrize(
    ("number", "noun", "said"),
    [(1, "vertex", "1 vertex"), (2, "cut mesh", "2 cut meshes"), (12345, "face", "12,345 faces")],
)
def test_counts_bring_their_nouns(number: int, noun: str, said: str) -> None:
    assert counted(number, noun) == said


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (0.0, "0 %"), (1.5e-5, "0.0015 %"), (0.0234, "2.3 %"), (0.0996, "10 %"), (0.62, "62 %"),
        (0.996, "100 %"), (1.0, "100 %"), (2.5, "250 %"),
    ],
)  # fmt: skip
def test_shares_are_never_told_in_powers_of_ten(share: float, said: str) -> None:
    assert percent(share) == said
