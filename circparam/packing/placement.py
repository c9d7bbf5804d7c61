"""Where every chart lies: the common result of all packers."""

from __future__ import annotations

from dataclasses import dataclass

from circparam.core.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Placement:
    """Where charts lie, in texels of a page.

    scale: texels per unit of the uv given. angle: (n,). offset: (n, 2) of the centre. page: (n,).
    """

    scale: float
    angle: FloatArray
    offset: FloatArray
    page: IntArray
