"""OFF: read, no place for uv."""

import re

import numpy as np

from circparam.core.arrays import ranges
from circparam.formats.memory import PlainDocument
from circparam.formats.polygons import check_corners, list_start, triangulate
from circparam.formats.source import Source
from circparam.formats.tokens import BYTE_ORDER_MARK, tokenize


def read_off(data: bytes, source: Source) -> PlainDocument:
    """Read OFF (also COFF, NOFF ...), polygons kept. Raises InputError if counts and content disagree.

    Our own scanner: trimesh's reader turns polygons into triangles and forgets which belong together.
    """
    text = re.sub(rb"#[^\r\n]*", b"", data).removeprefix(BYTE_ORDER_MARK)
    found = re.match(rb"\s*((?:ST)?C?N?4?n?OFF)\b", text)
    if found is None or b"4" in found.group(1) or b"n" in found.group(1) or b"\0" in text:
        raise source.error("this is not a text OFF file of three-dimensional points")
    t = tokenize(text[found.end() :], source)
    try:
        n, m = t.ints(np.arange(len(t.start))[:2]).tolist()
    except ValueError:
        raise source.error("the counts of vertices and faces are malformed") from None
    line = t.filled[t.filled > 1]  # the counts stand on one line, with or without a count of edges
    if n < 0 or m <= 0 or n + m > len(line):
        raise source.error(
            f"the header promises {n} vertices and {m} faces, the file has {len(line)} rows"
        )
    end = np.append(line, len(t.start))[1:]
    column = line[:n, None] + np.arange(3)
    if (end[:n] < line[:n] + 3).any():
        raise source.error("a vertex has fewer than three coordinates")
    try:
        points = t.floats(column.ravel())
        rows = line[n : n + m]
        size = t.ints(rows)
        if (size < 0).any() or (rows + 1 + size > end[n : n + m]).any():
            raise ValueError("a face has fewer corners than it says")
        at = np.repeat(rows + 1, size) + ranges(size)
        corners = t.ints(at)
    except ValueError as error:
        raise source.error(f"a row is malformed ({error})") from None
    points = points.reshape(-1, 3)
    check_corners(corners, n, source)
    polys = triangulate(points, corners, list_start(size))
    if len(polys.triangles) == 0:
        raise source.error("it has no faces: there is nothing to unwrap")
    features: tuple[str, ...] = ("polygons",) if polys.labels is not None else ()
    if found.group(1) != b"OFF" or (end[n : n + m] > rows + 1 + size).any():
        features += ("colours or normals",)
    return PlainDocument(source, "off", polys.mesh(points), features=features, polys=polys)
