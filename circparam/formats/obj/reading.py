"""Where the lines, words and corner fields of an OBJ file are, found with array operations."""

from functools import cached_property

import numpy as np

from circparam.core.arrays import ranges
from circparam.core.types import FloatArray, IntArray
from circparam.formats.polygons import list_start
from circparam.formats.source import Source
from circparam.formats.tokens import HASH, SLASH, SPACE, as_bytes, parsed, tokenize


class Scan:
    """Where the lines, words and corner fields of an OBJ file are."""

    def __init__(self, data: bytes, source: Source) -> None:
        self.data, self.source = data, source
        self.raw = as_bytes(data)
        self.tokens = t = tokenize(data, source, continuation=True)
        self.first = t.line[:-1]
        self.last = t.line[1:].copy()
        hashes = np.flatnonzero(t.clean[t.start] == HASH)
        if len(hashes):  # a comment ends its line
            line = np.searchsorted(t.line, hashes, side="right") - 1
            np.minimum.at(self.last, line, hashes)
        filled = self.last > self.first
        key = np.where(filled, self.first, 0)
        if len(t.start) == 0:
            self.keyword = np.zeros(len(key), np.int64)
            return
        size = t.end[key] - t.start[key]
        one = t.clean[t.start[key]].astype(np.int64)
        two = np.where(size > 1, t.clean[t.start[key] + 1], 0).astype(np.int64)
        # a keyword as one number: its first two letters and its length
        self.keyword = np.where(filled, one * 65536 + two * 256 + np.minimum(size, 255), 0)

    def of(self, word: bytes) -> IntArray:
        """Lines that begin with a keyword (of at most two letters; longer ones compare those and length)."""
        second = word[1] if len(word) > 1 else 0
        return np.flatnonzero(self.keyword == word[0] * 65536 + second * 256 + len(word))

    def lines(self, word: bytes) -> tuple[IntArray, list[bytes]]:
        """Lines that begin with a longer keyword, and the rest of each, stripped."""
        t, found, rest = self.tokens, [], []
        for line in self.of(word).tolist():
            k = self.first[line]
            if t.word(k) == word:
                stop = t.end[t.line[line + 1] - 1]
                found.append(line)
                rest.append(t.clean[t.end[k] : stop].tobytes().strip())
        return np.array(found, np.int64), rest

    def sections(self, *words: bytes) -> tuple[list[bytes], IntArray]:
        """The names of lines that begin with a keyword, (p,) the one that each face lies below.

        The first name is b"", of faces before any such line.
        """
        found = [self.lines(word) for word in words]
        lines = np.concatenate([each for each, _ in found])
        names = [name for _, each in found for name in each]
        order = np.argsort(lines)
        at = np.searchsorted(lines[order], self.face_lines)
        return [b"", *(names[k] for k in order.tolist())], at

    def numbers(self, lines: IntArray, width: int, *, optional: int = 0) -> FloatArray:
        """(k, width) numbers behind the keyword; the last ``optional`` of them may be missing (then 0)."""
        t = self.tokens
        given = self.last[lines] - self.first[lines] - 1
        short = np.flatnonzero(given < width - optional)
        if len(short):
            k = int(self.first[lines[short[0]]])
            raise t.error(k, f"{width - optional} numbers are needed, {given[short[0]]} are there")
        column = np.arange(width)
        index = self.first[lines][:, None] + 1 + column
        there = column < given[:, None]
        out = np.zeros(index.shape)
        out[there] = t.numbers(index[there])
        return out

    @cached_property
    def face_lines(self) -> IntArray:
        """The f lines."""
        return self.of(b"f")

    @cached_property
    def corner_tokens(self) -> IntArray:
        """(L,) the word of every face corner."""
        first, last = self.first[self.face_lines], self.last[self.face_lines]
        return np.repeat(first + 1, last - first - 1) + ranges(last - first - 1)

    @cached_property
    def corner_start(self) -> IntArray:
        """(p + 1,) offsets of the faces in the corners."""
        return list_start(self.last[self.face_lines] - self.first[self.face_lines] - 1)

    def fields(self, tokens: IntArray, count: int) -> tuple[IntArray, IntArray, IntArray]:
        """Split words like ``v/vt/vn``: ((L, count) numbers with 0 if empty, cut start, cut end).

        The cut is the byte range of the slash and number of vt, empty if there is none.
        """
        t = self.tokens
        start, end = t.start[tokens], t.end[tokens]
        text = t.text(tokens)
        stop = np.flatnonzero((text == SPACE) | (text == SLASH))
        size = np.diff(stop, prepend=-1) - 1
        last_field = np.flatnonzero(text[stop] == SPACE)
        first_field = np.concatenate([[0], last_field[:-1] + 1])[: len(last_field)]
        number = np.zeros(len(stop), np.int64)
        text[text == SLASH] = SPACE
        try:
            number[size > 0] = parsed(text, int((size > 0).sum()), np.int64)
        except ValueError:
            raise self._bad_corner(tokens) from None
        many = last_field - first_field + 1
        if (many > 3).any():
            raise t.error(int(tokens[many > 3][0]), "a corner has more than v/vt/vn")
        out = np.zeros((len(tokens), count), np.int64)
        for k in range(count):
            has = many > k
            out[has, k] = number[first_field[has] + k]
        cut_start = start + size[first_field] if len(tokens) else start
        cut_end = end.copy()
        three = many == 3
        cut_end[three] = cut_start[three] + 1 + size[first_field[three] + 1]
        return out, cut_start, cut_end

    def _bad_corner(self, tokens: IntArray) -> Exception:
        t = self.tokens
        for k in tokens.tolist():
            if not all(p == b"" or p.lstrip(b"+-").isdigit() for p in t.word(k).split(b"/")):
                wanted = "v, v/vt, v//vn or v/vt/vn"
                return t.error(k, f"{t.shown(k)!r} is not a face corner ({wanted})")
        return t.error(int(tokens[0]), "a face corner is malformed")

    @cached_property
    def cuts(self) -> tuple[IntArray, IntArray, IntArray]:
        """Corner numbers (L, 2) as written, and the byte range of each vt field."""
        return self.fields(self.corner_tokens, 2)

    def _counted(self, number: IntArray, word: bytes) -> IntArray:
        """(L,) numbers of corners counted from 0; negative ones count back from the last above their face."""
        if not (number < 0).any():
            return number - 1
        before = np.repeat(
            np.searchsorted(self.of(word), self.face_lines), np.diff(self.corner_start)
        )
        return np.where(number < 0, number + before, number - 1)

    def resolve(self, column: int, word: bytes, count: int) -> IntArray:
        """(L,) corner indices from 0; −1 if vt is empty. Raises InputError for 0 or beyond the end."""
        number = self.cuts[0][:, column]
        negative, index = number < 0, self._counted(number, word)
        bad = (index >= count) | (negative & (index < 0))
        if column == 0:
            bad |= number == 0
        else:
            # an explicit 0 is an error, an empty field is not: the cut of "/0" is longer than one byte
            bad |= (number == 0) & (self.cuts[2] - self.cuts[1] > 1)
        if bad.any():
            k = int(np.flatnonzero(bad)[0])
            raise self.tokens.error(
                int(self.corner_tokens[k]),
                f"index {int(number[k])} is outside the {count} {word.decode()} lines",
            )
        return index

    def corner_normals(self) -> FloatArray | None:
        """(L, 3) unit normals of the corners, 0 for corners without a direction; None if a corner has no normal
        or names a missing one."""
        lines = self.of(b"vn")
        if len(lines) == 0:
            return None
        index = self._counted(self.fields(self.corner_tokens, 3)[0][:, 2], b"vn")
        if (index < 0).any() or (index >= len(lines)).any():
            return None
        rows = self.numbers(lines, 3)
        length = np.linalg.norm(rows, axis=1, keepdims=True)
        usable = np.isfinite(length) & (length > 0)
        unit: FloatArray = np.where(usable, rows / np.where(usable, length, 1.0), 0.0)
        return unit[index]

    def libraries(self) -> list[str]:
        """The files that mtllib lines name."""
        names = (rest.decode("utf-8", "surrogateescape") for rest in self.lines(b"mtllib")[1])
        return list(dict.fromkeys(filter(None, names)))
