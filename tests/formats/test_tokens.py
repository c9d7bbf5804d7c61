"""Text as arrays, against the same done word by word with Python's own strings."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circparam.formats.tokens import (
    as_bytes,
    digits,
    splice,
    tokenize,
)

texts = st.text("ab1. \t\n\r#\\", max_size=60).map(str.encode)
edges_of_sizes = [0, 9, 10, 11, 99, 100, 999_999_999, 10**9, 10**18 - 1, 10**18, 2**63 - 1]


def words(tokens) -> list[bytes]:
    clean = tokens.clean
    return [clean[a:b].tobytes() for a, b in zip(tokens.start, tokens.end, strict=True)]


@given(texts)
def test_words_are_those_of_split(text: bytes) -> None:
    t = tokenize(text)
    assert words(t) == text.split()
    assert len(t.clean) == len(text) + 1


@given(texts)
def test_lines_are_those_of_the_text(text: bytes) -> None:
    t = tokenize(text)
    ends = b"\n" if b"\n" in text else b"\r"
    lines = text.split(ends)
    if lines[-1] == b"":
        lines.pop()
    assert t.count().tolist() == [len(line.split()) for line in lines]
    at = np.cumsum([0, *(len(line) + 1 for line in lines)])[:-1]
    assert t.line_start.tolist() == at.tolist()
    assert t.line[0] == 0
    assert t.line[-1] == len(t.start)


@pytest.mark.parametrize("newline", [b"\n", b"\r\n"])
def test_a_backslash_joins_lines_only_when_asked(newline: bytes) -> None:
    text = newline.join([b"a b \\", b"c", b"d\\e", b"\\", b"f"])
    plain, joined = tokenize(text), tokenize(text, continuation=True)
    assert plain.count().tolist() == [3, 1, 1, 1, 1]
    assert joined.count().tolist() == [3, 1, 1]
    assert words(joined) == [b"a", b"b", b"c", b"d\\e", b"f"]
    assert joined.line_start.tolist() == [0, text.index(b"d"), text.index(b"e") + 1 + len(newline)]
    assert tokenize(newline + b"a", continuation=True).count().tolist() == [0, 1]
    first = tokenize(b"\\" + newline + b"a", continuation=True)  # at the very beginning
    assert (words(first), first.count().tolist()) == ([b"a"], [1])


@pytest.mark.parametrize("prefix", [b"", b"/", b" x"])
def test_digits_where_numbers_get_longer(prefix: bytes) -> None:
    text, length = digits(np.array(edges_of_sizes), prefix)
    expected = [prefix + str(n).encode() for n in edges_of_sizes]
    assert text.tobytes() == b"".join(expected)
    assert length.tolist() == [len(e) for e in expected]
    nothing, none = digits(np.zeros(0, np.int64), prefix)
    assert (len(nothing), len(none)) == (0, 0)


@st.composite
def edits(draw: st.DrawFn) -> tuple[bytes, list[tuple[int, int, bytes]]]:
    """A text and ascending edits that do not overlap, empty ones among them."""
    data = draw(st.binary(max_size=40))
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=8)))
    pairs = list(zip(cuts[::2], cuts[1::2], strict=False))
    return data, [(a, b, draw(st.binary(max_size=5))) for a, b in pairs]


@given(edits())
def test_spliced_as_slices_would(given: tuple[bytes, list[tuple[int, int, bytes]]]) -> None:
    data, changes = given
    expected, at = b"", 0
    for a, b, text in changes:
        expected += data[at:a] + text
        at = b
    expected += data[at:]
    start, end = (np.array([c[k] for c in changes], np.int64) for k in (0, 1))
    text = as_bytes(b"".join(c[2] for c in changes))
    length = np.array([len(c[2]) for c in changes], np.int64)
    assert splice(data, start, end, text, length) == expected
    assert splice(as_bytes(data), start, end, text, length) == expected
