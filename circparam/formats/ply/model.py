"""Plain data that reading and editing a PLY file share."""

from dataclasses import field

import numpy as np

from circparam.core.arrays import IntArray
from circparam.core.records import dataclass
from circparam.formats.polygons import Polygons

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
