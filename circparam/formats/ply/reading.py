"""PLY as elements and properties, in ascii and both binary orders: where every value is in the file."""

import re
from dataclasses import field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import doubles, ranges
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.polygons import Polygons
from circparam.formats.source import Source
from circparam.formats.tokens import Tokens, as_bytes, tokenize

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
INDICES = ("vertex_indices", "vertex_index")


@dataclass
class Property:
    """One property: ``type`` and, for a list, ``count_type`` as NumPy codes without byte order."""

    name: str
    type: str
    count_type: str = ""


@dataclass
class Element:
    """One element and where its rows are.

    row: (n + 1,) int64 start of every row and the end of the last: bytes, or words where the file is ascii.
    """

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)
    row: IntArray = field(default_factory=lambda: np.zeros(1, np.int64))
    counts: dict[str, IntArray] = field(default_factory=dict)

    def find(self, *names: str) -> Property | None:
        """The first of the named properties that is there."""
        return next((p for name in names for p in self.properties if p.name == name), None)


@dataclass(frozen=True, eq=False)
class FaceLists:
    """The faces and strips of a file.

    polys: the faces and behind them every triangle of the strips; n_faces and n_corners count the former.
    strips: (k, 3) into the values of the strips. strip_lengths: (rows,) number of values of each strip.
    """

    polys: Polygons
    n_faces: int
    n_corners: int
    strips: IntArray
    strip_lengths: IntArray


def vertex_uv(vertex: Element) -> tuple[str, str] | None:
    """The names of the uv properties of the vertices."""
    return next((names for names in UV_NAMES if all(map(vertex.find, names))), None)


UNFILLED_BYTES = 1 << 12  # bytes
CHUNK_ROWS = 1 << 22  # rows that are looked at at once
KEYWORDS = {"ply", "format", "comment", "obj_info", "element", "property", "end_header"}
MAX_HEADER_BYTES = 1 << 20  # bytes: a thousand times the longest header of a real file


def is_ascii(head: bytes) -> bool:
    """Whether the header in the first bytes of a file says that its rows are text."""
    return re.search(rb"[\r\n][ \t]*format[ \t]+ascii\b", head[:MAX_HEADER_BYTES]) is not None


def look_ahead(head: bytes, tail: bytes, size: int, source: Source) -> None:
    """Refuse a binary file too short for its header, before the file is read.

    head, tail: its first and last bytes, at least as many as a header has and UNFILLED_BYTES. size: of the
    whole, in bytes. Raises InputError; later checks may refuse further files.
    """
    layout = Layout.__new__(Layout)
    layout.data, layout.source = head, source
    room = size - layout.begin()
    if layout.ascii:
        return
    for e in layout.elements:
        room -= layout.promised(e, room)
    last = layout.elements[-1] if layout.elements else Element("", 0)
    lists = any(p.count_type for p in last.properties)
    if last.count and lists and not tail[-UNFILLED_BYTES:].strip(b"\0"):
        raise layout.unfilled(last)


class Layout:
    """The header of a PLY file and the place of every value."""

    def __init__(self, data: bytes, source: Source) -> None:
        self.data, self.source = data, source
        self.raw = as_bytes(data)
        self.body = self.begin()
        self.tokens: Tokens | None = None
        if self.ascii:
            self.tokens = tokenize(data, source, self.body)
        at = 0 if self.ascii else self.body
        self._size = len(self.tokens.start) if self.tokens else len(data)
        for element in self.elements:
            at = self._rows(element, at)

    # the header ------------------------------------------------------------------------------

    def begin(self) -> int:
        """Read the header; where it ends."""
        found = re.search(
            rb"(?:^|[\r\n])end_header[ \t]*(\r\n|\n|\r)", self.data[:MAX_HEADER_BYTES]
        )
        if found is None:
            raise self.source.error("the PLY header has no end_header line: the file is cut short")
        self.newline = found.group(1)
        text = self.data[: found.end()].decode("latin-1")
        # file names in comments may hold line breaks: what follows such a line is comment too
        out: list[str] = []
        for line in text.split(self.newline.decode())[:-1]:
            is_comment = bool(out) and out[-1].split()[:1] in (["comment"], ["obj_info"])
            carried_on = is_comment and line.split() and line.split()[0] not in KEYWORDS
            out.append(f"comment {line.strip()}" if carried_on else line)
        self.lines = out
        self.elements: list[Element] = []
        self.format = ""
        for number, line in enumerate(self.lines, 1):
            words = line.split()
            try:
                self._header_line(words)
            except (IndexError, KeyError, ValueError):
                raise self.source.error(
                    f"line {number}: {line.strip()[:60]!r} is not a PLY header line"
                ) from None
        orders = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
        if self.format not in orders:
            raise self.source.error(f"unknown PLY format {self.format[:40]!r}")
        self.order = orders[self.format]
        self.ascii = self.format == "ascii"
        return found.end()

    def _header_line(self, words: list[str]) -> None:
        if not words or words[0] in ("ply", "comment", "obj_info", "end_header"):
            return
        if words[0] == "format":
            self.format = words[1]
        elif words[0] == "element":
            if int(words[2]) < 0:
                raise ValueError
            self.elements.append(Element(words[1], int(words[2])))
        elif words[0] == "property" and words[1] == "list":
            count, kind, name = words[2:5]
            if TYPES[count][0] == "f":
                raise ValueError
            self.elements[-1].properties.append(Property(name, TYPES[kind], TYPES[count]))
        elif words[0] == "property":
            self.elements[-1].properties.append(Property(words[2], TYPES[words[1]]))
        else:
            raise ValueError

    def element(self, name: str) -> Element:
        """The element of that name; one without properties and rows where the file has none."""
        return next((e for e in self.elements if e.name == name), Element(name, 0))

    # the rows --------------------------------------------------------------------------------

    def _width(self, code: str) -> int:
        return 1 if self.ascii else int(code[1])

    def _least(self, e: Element) -> int:
        """Least bytes of a row of an element."""
        return sum(self._width(p.count_type or p.type) for p in e.properties)

    def promised(self, e: Element, room: int) -> int:
        """Least bytes of the rows of an element; InputError if the file is too short for them."""
        least = self._least(e)
        if e.count * least > room:
            raise self.source.error(
                f"the header promises {e.count} rows of {e.name!r}, the file has at most "
                f"{max(room, 0) // max(least, 1)}"
            )
        return e.count * least

    def unfilled(self, e: Element) -> InputError:
        """A warning on a file that ends in zeros."""
        return self.source.error(
            f"the rows of {e.name!r} end in zeros: the file was not filled to its end"
        )

    def _rows(self, e: Element, at: int) -> int:
        """Find the rows of an element that begins at ``at``; returns where the next one begins."""
        self.promised(e, self._size - at)
        if not e.properties or e.count == 0:
            e.row, e.count = np.full(2, at, np.int64), 0
        elif any(p.count_type for p in e.properties):
            e.row = self._list_rows(e, at)
            if (self.place(e) != e.row[1:]).any():
                raise self.source.error(f"a row of {e.name!r} is malformed")
        else:
            e.row = at + self._least(e) * np.arange(e.count + 1, dtype=np.int64)
        return int(e.row[-1])

    def _list_rows(self, e: Element, at: int) -> IntArray:
        """Row starts of an element with lists: where rows are alike by stride, else one after the other."""
        if self.tokens is not None:
            line = self.tokens.filled
            k = int(np.searchsorted(line, at))
            rows = np.append(line[k:], self._size)[: e.count + 1]
            if len(rows) == e.count + 1 and rows[0] == at:
                e.row = rows
                if self._fits(e):
                    return rows
        else:
            # a stopped download leaves zeros at the end, where no row with a list is so
            end = self.raw[max(at, self._size - UNFILLED_BYTES) :]
            if e is self.elements[-1] and len(end) == UNFILLED_BYTES and not end.any():
                raise self.unfilled(e)
            one = self._chase(e, at, 1)
            stride = int(one[1] - one[0])
            if at + stride * e.count <= self._size:
                e.row = at + stride * np.arange(e.count + 1, dtype=np.int64)
                if self._fits(e):
                    return e.row
            elif self._cut_short(e, at, stride):
                raise self._short(e)
        return self._chase(e, at, e.count)

    def _cut_short(self, e: Element, at: int, stride: int) -> bool:
        """Whether all rows of the file are alike, and the bytes behind them are too few for the others.

        Row after row would tell the same of gigabytes in minutes. stride: bytes of the first row.
        """
        whole, left = divmod(self._size - at, stride)
        least = self._least(e)
        if (e.count - whole) * least <= left:
            return False
        for first in range(0, whole, CHUNK_ROWS):
            count = min(CHUNK_ROWS, whole - first)
            part = Element(e.name, count, e.properties)
            part.row = at + stride * np.arange(first, first + count + 1, dtype=np.int64)
            if not self._fits(part):
                return False
        return True

    def _fits(self, e: Element) -> bool:
        try:
            return bool((self.place(e) == e.row[1:]).all())
        except (ValueError, IndexError):
            return False

    def place(self, e: Element, stop: str = "") -> IntArray:
        """(n,) place of one property (of a list: of its count) in every row, or of the rows' ends.

        All rows are passed over at once.
        """
        at = e.row[:-1].copy()
        for p in e.properties:
            if p.name == stop:
                break
            if p.count_type:
                if p.name not in e.counts or len(e.counts[p.name]) != e.count or stop == "":
                    if (at + self._width(p.count_type) > self._size).any():
                        raise IndexError
                    counts = self.read(at, p.count_type).astype(np.int64)
                    if (counts < 0).any() or (counts > self._size).any():
                        raise ValueError
                    e.counts[p.name] = counts
                at += self._width(p.count_type) + self._width(p.type) * e.counts[p.name]
            else:
                at += self._width(p.type)
        return at

    def _chase(self, e: Element, at: int, n: int) -> IntArray:
        """Row after row: the place of a row depends on the counts of all before it."""
        out = np.empty(n + 1, np.int64)
        steps = [
            (self._width(p.count_type), p.count_type[0], self._width(p.type))
            if p.count_type
            else (self._width(p.type), "", 0)
            for p in e.properties
        ]
        order: Literal["big", "little"] = "big" if self.order == ">" else "little"
        data, tokens = self.data, self.tokens
        for i in range(n):
            out[i] = at
            for width, sign, item in steps:
                if sign:
                    if at + width > self._size:
                        raise self._short(e)
                    if tokens is not None:
                        word = tokens.word(at)
                        if not word.isdigit():
                            raise self.source.error(f"{word[:24]!r} is not a list length")
                        count = int(word)
                    else:
                        count = int.from_bytes(data[at : at + width], order, signed=sign == "i")
                        if count < 0:
                            raise self.source.error(f"a list has the length {count}")
                    at += item * count
                at += width
            if at > self._size:
                raise self._short(e)
        out[n] = at
        return out

    def _short(self, e: Element) -> Exception:
        return self.source.error(
            f"the header promises {e.count} rows of {e.name!r}, the file ends before"
        )

    # values ----------------------------------------------------------------------------------

    def read(self, at: IntArray, code: str) -> npt.NDArray[Any]:
        """Values of a type at ascending places. Raises ValueError if an ascii word is not a number."""
        if self.tokens is not None:
            return self.tokens.floats(at) if code[0] == "f" else self.tokens.ints(at)
        width = int(code[1])
        if len(at) == 0:
            return np.zeros(0, code)
        step = int(at[1] - at[0]) if len(at) > 1 else width
        if step > 0 and (np.diff(at) == step).all():
            got = np.ndarray((len(at),), self.order + code, self.data, int(at[0]), (step,))
        else:
            got = self.raw[at[:, None] + np.arange(width)].view(self.order + code)[:, 0]
        return got.astype(code)

    def scalar(self, e: Element, name: str) -> npt.NDArray[Any]:
        """(n,) values of a scalar property."""
        p = e.find(name)
        if p is None or p.count_type:
            raise self.source.error(f"element {e.name!r} has no scalar property {name!r}")
        return self._guard(self.place(e, name), p)

    def list(self, e: Element, name: str) -> tuple[npt.NDArray[Any], IntArray]:
        """Values of a list property, all rows one after the other, and (n,) their counts."""
        p = e.find(name)
        if p is None or not p.count_type:
            raise self.source.error(f"element {e.name!r} has no list property {name!r}")
        at = self.place(e, name) + self._width(p.count_type)
        counts = e.counts[name]
        places = np.repeat(at, counts) + ranges(counts) * self._width(p.type)
        return self._guard(places, p), counts

    def _guard(self, at: IntArray, p: Property) -> npt.NDArray[Any]:
        try:
            return self.read(at, p.type)
        except ValueError:
            raise self.source.error(f"property {p.name!r} holds a malformed number") from None

    def columns(self, e: Element, names: tuple[str, ...]) -> FloatArray:
        """(n, k) float64 scalar properties side by side."""
        return np.stack([doubles(self.scalar(e, name)) for name in names], 1)

    # bytes -----------------------------------------------------------------------------------

    def byte(self, place: IntArray) -> IntArray:
        """The byte at which a place (a word, in ascii) begins; behind the last word, the file's end."""
        if self.tokens is None:
            return place
        starts = np.append(self.tokens.start, len(self.data) - self.body)
        return starts[place] + self.body

    def byte_end(self, place: IntArray) -> IntArray:
        """The byte behind the value before ``place``."""
        if self.tokens is None:
            return place
        ends = np.concatenate([[0], self.tokens.end])
        return ends[place] + self.body
