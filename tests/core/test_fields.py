"""Ranges and the words of an option (tests/contracts/test_toy_option.py has the rest)."""

import math

import numpy as np
import pytest

from circparam.core.fields import Range
from circparam.core.limits import check_page
from circparam.errors import OptionError

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


@pytest.mark.parametrize(("resolution", "padding"), [(1, 0), (3, 1), (64, 31), (65, 32)])
def test_a_page_with_room_for_a_texel(resolution: int, padding: int) -> None:
    check_page(resolution, padding)
    with pytest.raises(OptionError, match=f"--padding {padding} or less"):
        check_page(resolution, padding + 1)
