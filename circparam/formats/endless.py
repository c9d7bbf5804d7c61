"""Texts with a line that never ends: refused while they are read, before they fill the memory.

A word takes 16 bytes beside its own, so a line of gigabytes takes tens of them, and no mesh has such a line.
"""

from collections.abc import Iterable, Iterator
from typing import BinaryIO

from circparam.formats.source import Source

BLOCK_BYTES = 1 << 20  # bytes that are looked at in one go
LONGEST_LINE_BYTES = 1 << 24  # bytes; a polygon of a million corners takes as many
# Bytes of a line for each byte before it. A row of a mesh names vertices whose own rows, longer than
# their numbers, stand before it. A strip of a whole mesh names each about six times, as triangles do.
LINE_BYTES_PER_BYTE = 6


class LineLimit:
    """Follows a text block by block, and refuses a line that is too long for any mesh."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._read = self._begin = self._newlines = self._returns = 0

    def follow(self, block: bytes) -> None:
        """Take the next block, of at most ``BLOCK_BYTES`` bytes. Raises InputError if its first line began too
        far before."""
        ends = block.find(b"\n"), block.find(b"\r")
        first = min((k for k in ends if k >= 0), default=len(block))
        longest = max(LONGEST_LINE_BYTES, LINE_BYTES_PER_BYTE * self._begin)
        if self._read + first - self._begin > longest:
            line = 1 + (self._newlines or self._returns)
            raise self._source.error(
                f"line {line} is longer than {longest >> 20} MB: no mesh has such lines"
            )
        self._newlines += block.count(b"\n")
        self._returns += block.count(b"\r")
        if first < len(block):
            self._begin = self._read + 1 + max(block.rfind(b"\n"), block.rfind(b"\r"))
        self._read += len(block)


def blocks_in(file: BinaryIO) -> Iterator[bytes]:
    """The rest of a file, block by block."""
    return iter(lambda: file.read(BLOCK_BYTES), b"")


def check_lines(blocks: Iterable[bytes], source: Source) -> None:
    """Refuse a text with an endless line. Raises InputError; nothing behind that line is asked for."""
    limit = LineLimit(source)
    for block in blocks:
        limit.follow(block)
