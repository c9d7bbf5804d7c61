"""Text as arrays, against the same done word by word with Python's own strings."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circparam.formats.tokens import (
    as_bytes,
    bad_token,
    digits,
    fill,
    gather,
    interleave,
    line_number,
    parse_floats,
    parse_ints,
    splice,
    take_ranges,
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


def test_line_numbers_count_from_one() -> None:
    assert [line_number(b"a\nb\n\nc", k) for k in range(6)] == [1, 1, 2, 2, 3, 4]
    assert line_number(b"a\rb\rc", 4) == 3
    assert line_number(b"a\r\nb", 3) == 2


@given(texts, st.data())
def test_gathered_words_keep_one_blank_each(text: bytes, data: st.DataObject) -> None:
    t = tokenize(text)
    pick = np.array(
        data.draw(st.lists(st.booleans(), min_size=len(t.start), max_size=len(t.start)))
    )
    k = np.flatnonzero(pick) if len(pick) else np.zeros(0, np.int64)
    expected = b"".join(w + b" " for w, p in zip(text.split(), pick, strict=True) if p)
    assert gather(t.clean, t.start[k], t.end[k]).tobytes() == expected


def test_numbers_are_counted() -> None:
    assert parse_floats(as_bytes(b"1 -2.5e-3 .5"), 3).tolist() == [1, -0.0025, 0.5]
    assert parse_ints(as_bytes(b"1 -20 +3"), 3).tolist() == [1, -20, 3]
    for count in (2, 4):
        with pytest.raises(ValueError, match=f"{count} numbers expected, 3 found"):
            parse_floats(as_bytes(b"1 2 3"), count)
        with pytest.raises(ValueError, match=f"{count} whole numbers expected, 3 found"):
            parse_ints(as_bytes(b"1 2 3"), count)


def test_the_word_that_is_no_number_is_found() -> None:
    t = tokenize(b"1 2.5 x 3")
    assert bad_token(t, np.arange(4), float) == 2
    assert bad_token(t, np.arange(4), int) == 1
    assert bad_token(t, np.array([3, 0]), int) == 3  # none is wrong: the first


@pytest.mark.parametrize("prefix", [b"", b"/", b" x"])
def test_digits_where_numbers_get_longer(prefix: bytes) -> None:
    text, length = digits(np.array(edges_of_sizes), prefix)
    expected = [prefix + str(n).encode() for n in edges_of_sizes]
    assert text.tobytes() == b"".join(expected)
    assert length.tolist() == [len(e) for e in expected]
    nothing, none = digits(np.zeros(0, np.int64), prefix)
    assert (len(nothing), len(none)) == (0, 0)


@given(st.lists(st.integers(0, 2**63 - 1)))
def test_digits_are_those_of_str(numbers: list[int]) -> None:
    text, length = digits(np.array(numbers, np.int64), b"/")
    assert text.tobytes() == b"".join(b"/%d" % n for n in numbers)
    assert length.tolist() == [len(str(n)) + 1 for n in numbers]


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


def test_ranges_may_touch_and_be_empty() -> None:
    mask = fill(6, np.array([2, 0, 2]), np.array([0, 2, 2]))
    assert mask.tolist() == [True, True, True, True, False, False]
    assert fill(3, np.array([1]), np.array([2])).tolist() == [False, False, True]
    out = take_ranges(as_bytes(b"abcdef"), np.array([4, 0, 0]), np.array([2, 1, 3]))
    assert out.tobytes() == b"efaabc"


@given(st.lists(st.tuples(st.binary(max_size=3), st.binary(max_size=3), st.binary(max_size=3))))
def test_pieces_are_joined_row_by_row(rows: list[tuple[bytes, bytes, bytes]]) -> None:
    parts = []
    for k in range(3):
        column = [row[k] for row in rows]
        parts.append((as_bytes(b"".join(column)), np.array([len(c) for c in column], np.int64)))
    text, length = interleave(parts)
    assert text.tobytes() == b"".join(b"".join(row) for row in rows)
    assert length.tolist() == [sum(map(len, row)) for row in rows]


@given(st.integers(1, 4), st.integers(1, 4), st.binary(min_size=1, max_size=40))
def test_rows_of_one_length_are_cut_and_joined_like_others(a: int, b: int, data: bytes) -> None:
    rows = len(data) - max(a, b) + 1
    if rows < 1:
        return
    start = np.arange(rows)[::-1].copy()
    first = take_ranges(as_bytes(data), start, np.full(rows, a))
    second = take_ranges(as_bytes(data), start, np.full(rows, b))
    assert first.tobytes() == b"".join(data[s : s + a] for s in start)
    text, length = interleave([(first, np.full(rows, a)), (second, np.full(rows, b))])
    assert text.tobytes() == b"".join(data[s : s + a] + data[s : s + b] for s in start)
    assert (length == a + b).all()
