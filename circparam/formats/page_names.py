"""Names of pages in comments of text formats: ``circparam page 1001 steel``, a line for each page."""

import re
from collections.abc import Sequence

FIRST_UDIM = 1001  # UDIM number of the first page
NOTE_START = "circparam page "


def page_lines(names: Sequence[str]) -> list[str]:
    """A line for each page, without the sign of a comment; white space in a name becomes single blanks."""
    return [
        f"{NOTE_START}{FIRST_UDIM + k} {' '.join(name.split())}" for k, name in enumerate(names)
    ]


def in_ply_header(data: bytes, names: Sequence[str]) -> bytes:
    """A PLY file whose header names its pages, and no pages of an earlier layout."""
    end = re.search(rb"(?:^|[\r\n])end_header", data)
    if end is None:
        return data
    head = data[: end.start() + 1]
    first = re.search(rb"format [^\r\n]*(\r\n|\n|\r)", head)
    if first is None or not (names or b"comment " + NOTE_START.encode() in head):
        return data
    newline = first.group(1)
    rest = newline.join(
        line
        for line in head[first.end() :].split(newline)
        if not line.startswith(b"comment " + NOTE_START.encode())
    )
    said = b"".join(b"comment " + line.encode() + newline for line in page_lines(names))
    return head[: first.end()] + said + rest + data[end.start() + 1 :]
