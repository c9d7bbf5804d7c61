"""Names of pages in comments of text formats: ``circparam page 1001 steel``, a line for each page."""

from collections.abc import Sequence

FIRST_UDIM = 1001  # UDIM number of the first page
NOTE_START = "circparam page "


def page_lines(names: Sequence[str]) -> list[str]:
    """A line for each page, without the sign of a comment; white space in a name becomes single blanks."""
    return [
        f"{NOTE_START}{FIRST_UDIM + k} {' '.join(name.split())}" for k, name in enumerate(names)
    ]


def with_pages(header: Sequence[str], names: Sequence[str]) -> list[str]:
    """The lines of a PLY header (latin-1) that name these pages, and no pages of an earlier layout."""
    lines = [line for line in header if not line.startswith(f"comment {NOTE_START}")]
    at = 1 + next(k for k, line in enumerate(lines) if line.split()[:1] == ["format"])
    lines[at:at] = [f"comment {line}".encode().decode("latin-1") for line in page_lines(names)]
    return lines
