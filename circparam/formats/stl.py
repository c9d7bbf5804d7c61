"""STL: no place for uv, and no shared vertices. Binary files are one array, text is read through trimesh."""

import re

import numpy as np

from circparam.core.arrays import doubles
from circparam.core.plural import counted
from circparam.core.types import FloatArray, IntArray
from circparam.formats.memory import PlainDocument
from circparam.formats.second_reader import triangles_of
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh

HEADER_BYTES = 84  # bytes before the first facet: a title, and the number of facets
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes, source: Source) -> PlainDocument:
    """Read STL: faces in the order of the file, corners at exactly the same position as one vertex.

    Vertices are numbered by their first corner. Raises InputError if the file has no faces, or cannot be
    read as STL.
    """
    if is_text_stl(data):
        return _through_trimesh(data, source)
    facets = np.frombuffer(data, FACET, _promised(data, len(data), source), HEADER_BYTES)
    corners = doubles(facets["corners"].reshape(-1, 3))
    behind = len(data) - HEADER_BYTES - facets.nbytes
    warnings = (f"{counted(behind, 'byte')} behind the last facet were left out",) if behind else ()
    return PlainDocument(source, "stl", _welded(corners), warnings=warnings)


def is_text_stl(data: bytes) -> bool:
    """Whether a file, or its beginning, is text; binary files may begin with 'solid' too, but hold zeros."""
    return data.lstrip()[:5].lower() == b"solid" and b"\0" not in data


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
            f"its {counted(size, 'byte')} are shorter than the header of an STL: it is cut short"
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


def _through_trimesh(data: bytes, source: Source) -> PlainDocument:
    """Text, one solid or several; the reader takes 0.3 s to import."""
    # trimesh guesses other encodings by a further package
    text = data.decode("utf-8", "replace").encode()
    try:
        arrays, solids = triangles_of(text, "stl", None)
    except Exception as error:  # trimesh raises whatever its parser meets
        raise source.error(f"cannot be read as STL ({error or type(error).__name__})") from None
    if not solids:
        facets = (rb"\bfacet\s+normal", rb"\bendfacet\b")
        begun, ended = (len(re.findall(word, data, re.I)) for word in facets)
        if begun != ended:
            raise source.error(f"{begun} facets begin and {ended} end: it is cut short")
        raise source.error("it has no faces: there is nothing to unwrap")
    corners = arrays["points"][arrays["faces"]].reshape(-1, 3)
    groups = arrays["group"] if len(solids) > 1 else None
    return PlainDocument(source, "stl", _welded(corners, groups))
