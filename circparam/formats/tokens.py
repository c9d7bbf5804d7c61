"""Text and bytes as arrays: tokens, numbers, and edits of a file at many places at once."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import ranges
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.source import Source

ByteArray: TypeAlias = npt.NDArray[np.uint8]
SPACE, NEWLINE, RETURN, BACKSLASH, SLASH, HASH = (ord(c) for c in " \n\r\\/#")
BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # that some programs write before UTF-8
SHOWN_BYTES = 24  # bytes of a word that a message quotes
_TO_SPACE = bytes.maketrans(b"\t\n\v\f\r", b"     ")


def as_bytes(data: bytes) -> ByteArray:
    """The bytes as a read-only uint8 array, without a copy."""
    return np.frombuffer(data, np.uint8)


@dataclass(frozen=True)
class Tokens:
    """Words of a text between white space.

    source, data: the file, whose text begins at byte ``begin``. clean: the text with all white space turned
    into blanks and one blank behind the last word. start, end: (t,) int64 byte range of each word. line:
    (n + 1,) int64, first word of every logical line; line_start: (n,) int64, byte at which each begins.
    """

    source: Source
    data: bytes
    begin: int
    clean: ByteArray
    start: IntArray
    end: IntArray
    line: IntArray
    line_start: IntArray

    @property
    def filled(self) -> IntArray:
        """The first word of every line that has one."""
        return self.line[:-1][np.diff(self.line) > 0]

    def word(self, k: int) -> bytes:
        """One word."""
        return self.clean[self.start[k] : self.end[k]].tobytes()

    def shown(self, k: int) -> str:
        """The beginning of a word, for messages."""
        return self.word(k)[:SHOWN_BYTES].decode("ascii", "backslashreplace")

    def error(self, k: int, cause: str) -> InputError:
        """An InputError that names the line of a word, counted from 1."""
        head = self.data[: self.begin + int(self.start[k])]
        line = 1 + (head.count(b"\n") or head.count(b"\r"))
        return self.source.error(f"line {line}: {cause}")

    def text(self, words: IntArray) -> ByteArray:
        """The given words, ascending, each with the blank behind it."""
        if not words.size:
            return np.zeros(0, np.uint8)
        mark = np.zeros(len(self.clean) + 1, np.int8)
        mark[self.start[words]] = 1
        mark[self.end[words] + 1] -= 1
        return self.clean[np.cumsum(mark, dtype=np.int8, out=mark)[:-1].view(np.bool_)]

    def floats(self, words: IntArray) -> FloatArray:
        """The given words as decimal numbers, correctly rounded. Raises ValueError if they are others."""
        return parsed(self.text(words), words.size, np.float64)

    def numbers(self, words: IntArray) -> FloatArray:
        """The given words as decimal numbers. Raises InputError with the place if one is something else."""
        try:
            return self.floats(words)
        except ValueError:
            k = next((k for k in words.tolist() if not _is_number(self.word(k))), int(words[0]))
            comma = ": write decimal points" if "," in self.shown(k) else ""
            raise self.error(k, f"{self.shown(k)!r} is not a number{comma}") from None

    def ints(self, words: IntArray) -> IntArray:
        """The given words as whole numbers. Raises ValueError if they are others."""
        return parsed(self.text(words), words.size, np.int64)


def _is_number(word: bytes) -> bool:
    try:
        float(word.replace(b"_", b"?"))  # Python alone takes 1_000
    except ValueError:
        return False
    return True


def tokenize(data: bytes, source: Source, begin: int = 0, *, continuation: bool = False) -> Tokens:
    """Split a text into words and lines. ``continuation``: a backslash before a line's end joins lines.

    begin: byte of the file at which the text begins; places of words count from there.
    Line ends are ``\\n``, ``\\r\\n``, or ``\\r`` alone where the text has no ``\\n``.
    """
    text = data[begin:]
    raw = as_bytes(text)
    clean = np.frombuffer(bytearray(text.translate(_TO_SPACE)) + b" ", np.uint8)
    if text.startswith(BYTE_ORDER_MARK):
        clean[: len(BYTE_ORDER_MARK)] = SPACE
    ends = np.flatnonzero(raw == (NEWLINE if b"\n" in text else RETURN))
    if continuation and b"\\" in text and len(ends):
        before = ends - 1
        before = before - ((before > 0) & (raw[before] == RETURN) & (raw[ends] == NEWLINE))
        joined = (before >= 0) & (raw[before] == BACKSLASH)
        clean[before[joined]] = SPACE
        ends = ends[~joined]
    line_start = np.concatenate([[0], ends + 1])
    if line_start[-1] >= len(raw):
        line_start = line_start[:-1]
    word = clean != SPACE
    edge = np.flatnonzero(word[1:] != word[:-1]) + 1
    if len(word) and word[0]:
        edge = np.concatenate([[0], edge])
    start, end = edge[0::2], edge[1::2]
    line = np.concatenate([np.searchsorted(start, line_start), [len(start)]])
    return Tokens(source, data, begin, clean, start, end, line.astype(np.int64), line_start)


def parsed(text: ByteArray, count: int, kind: type) -> npt.NDArray[Any]:
    """``count`` numbers of a text; raises ValueError if the text holds others."""
    out: npt.NDArray[Any] = np.fromstring(text.tobytes(), dtype=kind, sep=" ")
    if len(out) != count:
        raise ValueError(f"{count} numbers expected, {len(out)} found")
    return out


def digits(numbers: IntArray, prefix: bytes = b"") -> tuple[ByteArray, IntArray]:
    """Decimal digits of non-negative numbers, each behind ``prefix``: (text, (k,) length of each piece)."""
    n = len(numbers)
    text = np.asarray(numbers, np.int64).astype("S19").view(np.uint8).reshape(n, 19)
    before = np.broadcast_to(as_bytes(prefix), (n, len(prefix)))
    text = np.concatenate([before, text], axis=1)
    there = text > 0  # NumPy fills up with zero bytes
    return text[there], there.sum(1)


def fill(total: int, lengths: IntArray, offsets: IntArray) -> npt.NDArray[np.bool_]:
    """(total,) mask of the ranges that begin at ``offsets`` (ascending, apart) and have those lengths."""
    mark = np.zeros(total + 1, np.int8)
    some = lengths > 0
    mark[offsets[some]] += 1
    mark[(offsets + lengths)[some]] -= 1
    return np.cumsum(mark, dtype=np.int8, out=mark)[:-1].view(np.bool_)


def splice(
    data: bytes | ByteArray, start: IntArray, end: IntArray, text: ByteArray, length: IntArray
) -> bytes:
    """Replace many byte ranges at once.

    start, end: (k,) ascending ranges that do not overlap (an empty one inserts before ``start``).
    text: the replacements one after the other, length: (k,) the length of each.
    """
    raw = as_bytes(data) if isinstance(data, bytes) else data
    removed = end - start
    at = start - (np.cumsum(removed) - removed) + (np.cumsum(length) - length)
    new = fill(len(raw) - int(removed.sum()) + int(length.sum()), length, at)
    out = np.empty(len(new), np.uint8)
    out[new] = text
    out[~new] = raw[~fill(len(raw), removed, start)]
    return out.tobytes()


def take_ranges(data: ByteArray, start: IntArray, length: IntArray) -> ByteArray:
    """The bytes of many ranges, in the given order (they may repeat), one after the other."""
    result: ByteArray
    # rows of one length, as binary files have: no index for every byte
    if _alike(length) and length[0] > 0:
        result = np.lib.stride_tricks.sliding_window_view(data, int(length[0]))[start].reshape(-1)
    else:
        result = data[np.repeat(start, length) + ranges(length)]
    return result


def _alike(length: IntArray) -> bool:
    """Whether all lengths are the same, and there are some."""
    return len(length) > 0 and bool((length == length[0]).all())


def interleave(parts: list[tuple[ByteArray, IntArray]]) -> tuple[ByteArray, IntArray]:
    """Join pieces row by row: each part gives one piece a row; the result has one longer piece a row."""
    length = np.sum([size for _, size in parts], axis=0)
    if all(_alike(size) for _, size in parts):
        rows = [text.reshape(len(size), int(size[0])) for text, size in parts]
        return np.concatenate(rows, axis=1).reshape(-1), length
    at = np.cumsum(length) - length
    out = np.empty(int(length.sum()), np.uint8)
    for text, size in parts:
        out[fill(len(out), size, at)] = text
        at = at + size
    return out, length
