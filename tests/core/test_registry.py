"""Tables: rows by name, tags that are known, and the nearest name for one that is not."""

import pytest

from circparam.core.registry import TAGS, Row, Table, unknown_name
from circparam.errors import OptionError


def table() -> Table[type]:
    return Table(
        "fruit", Row("apple", str, "red", tags=frozenset({"positive"})), Row("pear", int, "green")
    )


def test_rows_by_name_in_their_order() -> None:
    fruit = table()
    assert fruit.names() == [row.name for row in fruit] == ["apple", "pear"]
    assert fruit["pear"].function is int
    assert "pear" in fruit
    assert "plum" not in fruit
    assert fruit.tagged("positive") == ["apple"]
    assert fruit.tagged("flip-free") == []


def test_an_unknown_name_is_an_error_with_what_is_near() -> None:
    with pytest.raises(OptionError, match=r"^unknown fruit 'appel': did you mean apple\?$"):
        table()["appel"]
    with pytest.raises(OptionError, match=r"^unknown fruit 'xyz': choose one of apple, pear$"):
        table()["xyz"]


def test_at_most_two_near_names() -> None:
    names = ["abcd", "abce", "abcf", "zzzz"]
    near = unknown_name("word", "abc", names).split("did you mean ")[1].rstrip("?").split(" or ")
    assert len(near) == 2
    assert set(near) < {"abcd", "abce", "abcf"}


def test_tags_that_nobody_proves_are_refused() -> None:
    with pytest.raises(ValueError, match=r"'magic'.*'wand'"):
        Row("wand", str, "", tags=frozenset({"magic", *TAGS}))


def test_a_row_accepts_nothing_unless_it_says_so() -> None:
    assert Row("apple", str, "").accepts == frozenset()
