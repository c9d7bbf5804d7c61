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


def test_an_unknown_name_is_an_error_with_at_most_two_that_are_near() -> None:
    with pytest.raises(OptionError, match=r"^unknown fruit 'appel': did you mean apple\?$"):
        table()["appel"]
    with pytest.raises(OptionError, match=r"^unknown fruit 'xyz': choose one of apple, pear$"):
        table()["xyz"]
    said = unknown_name("word", "abc", ["abcd", "abce", "abcf", "zzzz"])
    assert said.count("abc") == 3


def test_tags_that_nobody_proves_are_refused() -> None:
    with pytest.raises(ValueError, match=r"'magic'.*'wand'"):
        Row("wand", str, "", tags=frozenset({"magic", *TAGS}))
