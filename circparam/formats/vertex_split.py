"""Duplicate vertices along seams, for formats in which a vertex has one uv."""

import numpy as np

from circparam.core.arrays import numbered_rows, relabel
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray


@dataclass(frozen=True)
class Split:
    """A vertex for every uv that a vertex has.

    corner: (L,) int64 output vertex of each corner. source: (k,) int64 input vertex of each output
    vertex (the first n are 0..n−1). uv: (k, w) row of each output vertex (0 if no corner gives one).
    """

    corner: IntArray
    source: IntArray
    uv: FloatArray

    @property
    def added(self) -> int:
        """Number of duplicates behind the input vertices."""
        return len(self.source) - int(self.source.max(initial=-1)) - 1


def duplicated(count: int, lines: str = "seams") -> str:
    """The note on vertices that seams, or other lines, added."""
    return f"{counted(count, 'vertex')} duplicated along {lines}, behind the input's"


def split_vertices(n: int, vertex: IntArray, uv: FloatArray, corner_uv: IntArray) -> Split:
    """One uv a vertex. n: number of vertices. vertex: (L,) of each corner. uv: (k, w) as stored, of any width.

    corner_uv: (L,) into uv, −1 for none (stored as 0). The first corner of a vertex keeps it; every other
    uv at the vertex gets a duplicate, appended in the order of first appearance. Equal uv share one vertex.
    """
    table = np.concatenate([uv, np.zeros((1, uv.shape[1]))]) + 0.0  # −0 equals 0; row −1 is "none"
    value, same = numbered_rows(table)  # equal uv, equal number; a row of the table for each
    mine = same[corner_uv]
    kept = np.full(n, -1, np.int64)
    kept[vertex[::-1]] = mine[::-1]
    other = np.flatnonzero(mine != kept[vertex])
    key = vertex[other] * len(table) + mine[other]
    count, rank = relabel(key)
    corner = vertex.copy()
    corner[other] = n + rank
    duplicate = np.empty(count, np.int64)
    duplicate[rank] = other  # any of each
    source = np.concatenate([np.arange(n), vertex[duplicate]])
    number = np.concatenate([np.where(kept < 0, same[-1], kept), mine[duplicate]])
    return Split(corner, source, table[value[number]])
