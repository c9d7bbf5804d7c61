"""STL: no place for uv, and no shared vertices. Binary files are one array, text is a list of words."""

import numpy as np

from circparam.core.arrays import doubles, mask_of, relabel
from circparam.core.plural import counted
from circparam.core.types import FloatArray, IntArray
from circparam.formats.memory import PlainDocument
from circparam.formats.source import Source
from circparam.formats.tokens import BYTE_ORDER_MARK, Tokens, tokenize
from circparam.mesh.mesh import Mesh

HEADER_BYTES = 84  # bytes before the first facet: a title, and the number of facets
LOWER_CASE = 0x20  # the bit in which small letters of ASCII differ from capital ones
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes, source: Source) -> PlainDocument:
    """Read STL: faces in the order of the file, corners at exactly the same position as one vertex.

    Vertices are numbered by their first corner. Raises InputError if the file has no faces, or cannot be
    read as STL.
    """
    if is_text_stl(data):
        return _read_text(data, source)
    facets = np.frombuffer(data, FACET, _promised(data, len(data), source), HEADER_BYTES)
    corners = doubles(facets["corners"].reshape(-1, 3))
    behind = len(data) - HEADER_BYTES - facets.nbytes
    warnings = (f"{counted(behind, 'byte')} behind the last facet were left out",) if behind else ()
    return PlainDocument(source, "stl", _welded(corners), warnings=warnings)


def is_text_stl(data: bytes) -> bool:
    """Whether a file, or its beginning, is text; binary files may begin with 'solid' too, but hold zeros."""
    text = data.removeprefix(BYTE_ORDER_MARK).lstrip()
    return text[:5].lower() == b"solid" and b"\0" not in data


def look_ahead(head: bytes, tail: bytes, size: int, source: Source) -> None:
    """Refuse a binary file of a size that its header denies, before the file is read. Raises InputError.

    head, tail: its first and last bytes. size: of the whole, in bytes.
    """
    if not is_text_stl(head):
        _promised(head, size, source)


def _promised(head: bytes, size: int, source: Source) -> int:
    """The number of facets of a binary file of so many bytes. Raises InputError if it holds more or fewer
    than its header promises."""
    if size < HEADER_BYTES:
        raise source.error(
            f"its {counted(size, 'byte')} are shorter than the header of an STL: "
            "it is cut short; copy or export it again"
        )
    count = int.from_bytes(head[HEADER_BYTES - 4 : HEADER_BYTES], "little")
    there = (size - HEADER_BYTES) // FACET.itemsize
    if there != count:
        short = "it is cut short, or " if there < count else ""
        raise source.error(
            f"its header promises {count} facets, its length is that of {there}: {short}whatever wrote it did "
            "not fill in the number; export it again"
        )
    if count == 0:
        raise source.error("it has no faces: there is nothing to unwrap")
    return count


def _welded(corners: FloatArray, groups: IntArray | None = None) -> Mesh:
    """The mesh of corners (3 m, 3), those at one position as one vertex, and of labels (m,)."""
    loose = Mesh(corners, np.arange(len(corners)).reshape(-1, 3))
    kept, vertex = np.unique(loose.weld, return_inverse=True)
    return Mesh(corners[kept], vertex.reshape(-1, 3), groups=groups)


def _read_text(data: bytes, source: Source) -> PlainDocument:
    """Text, one solid or several: three points between every ``outer loop`` and ``endloop``.

    White space may be of any kind. Raises InputError for a facet that has not three points.
    """
    t = tokenize(data, source)
    n = len(t.start) + 1
    loops, ended = _places(t, b"loop"), _places(t, b"endloop")
    begun = loops[mask_of(n, _places(t, b"outer"))[loops - 1]]
    if len(begun) != len(ended):
        raise source.error(
            f"{len(begun)} facets begin and {len(ended)} end: it is cut short; copy or export it again"
        )
    if len(ended) == 0:
        raise source.error("it has no faces: there is nothing to unwrap")
    # outer loop, three times vertex x y z, endloop
    points = ended[:, None] - np.array([12, 8, 4])
    sound = (begun == ended - 13) & mask_of(n, _places(t, b"vertex"))[points.clip(0)].all(axis=1)
    if not sound.all():
        word = int(begun[np.flatnonzero(~sound)[0]])
        raise t.error(word, "a facet is not three times 'vertex x y z': export it again")
    corners = t.numbers((points[:, :, None] + np.arange(1, 4)).ravel()).reshape(-1, 3)
    closed = _places(t, b"endsolid")
    count, groups = relabel(np.searchsorted(closed, ended))
    mesh = _welded(corners, groups if count > 1 else None)
    whole = len(closed) > 0 and closed[-1] > ended[-1]
    doubt = "no endsolid follows its last facet: it may be cut short"
    return PlainDocument(source, "stl", mesh, warnings=() if whole else (doubt,))


def _places(t: Tokens, word: bytes) -> IntArray:
    """The tokens that are a word, in letters of any case."""
    found = np.flatnonzero(t.end - t.start == len(word))
    for k, letter in enumerate(word):
        found = found[t.clean[t.start[found] + k] | LOWER_CASE == letter]
    return found
