"""Plain data that reading and editing a glTF tree share."""

from typing import Any, TypeAlias

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import IntArray

Json: TypeAlias = dict[str, Any]
# accessor.componentType as NumPy code, and accessor.type as a number of components (glTF 2.0, 3.6.2.2)
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
TYPE_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
COMPONENT_OF = {np.dtype(code): number for number, code in COMPONENTS.items()}
TRIANGLES, STRIP, FAN = 4, 5, 6  # primitive.mode
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963  # bufferView.target


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles of one primitive.

    triangles: (k, 3) int64 into the vertices of its pool, as they are seen. first: its first face. turned:
    whether the file winds them the other way, because the node of the mesh mirrors it (glTF 2.0, 3.7.4).
    """

    mesh: int
    number: int
    pool: int
    mode: int
    triangles: IntArray
    first: int
    turned: bool = False

    @property
    def faces(self) -> slice:
        """Its faces among all."""
        return slice(self.first, self.first + len(self.triangles))

    def entry(self, tree: Json) -> Json:
        """Its entry in a tree, or in a copy of it."""
        return tree["meshes"][self.mesh]["primitives"][self.number]


@dataclass(frozen=True, eq=False)
class Pool:
    """Vertices that primitives of one mesh share: the same accessors for every attribute and target.

    first: number of its first point in ``Mesh.points``. count: number of its points.
    """

    attributes: dict[str, int]
    targets: list[dict[str, int]]
    first: int
    count: int

    @property
    def part(self) -> slice:
        """Its points among all."""
        return slice(self.first, self.first + self.count)


def index_type(n: int, least: int) -> int:
    """The component type of indices of n vertices: the smallest from ``least`` on that holds them.

    The highest value of a type is kept free: it restarts strips (glTF 2.0, 3.7.2.1).
    """
    return next(k for k in (5121, 5123, 5125) if k >= least and n <= np.iinfo(COMPONENTS[k]).max)
