"""Placements of all charts, and the task of a packer: the common data of all packers."""

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import TypeAlias

from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes


@dataclass(frozen=True, eq=False)
class Placement:
    """Where charts lie, in texels of a page.

    scale: texels per unit of the uv given. angle: (n,) radians. offset: (n, 2) of the centre. page: (n,).
    """

    scale: float
    angle: FloatArray
    offset: FloatArray
    page: IntArray


@dataclass(frozen=True, eq=False)
class PackTask:
    """The task of a packer.

    found: placements of the packers before it, by the name of their row; it may start from them.
    sound: whether a placement passes the check on the raster (a packer may ask before it settles for one).
    least: a placement at a smaller scale is of no use.
    """

    shapes: Shapes
    options: PackOptions
    monitor: Monitor
    found: Mapping[str, Placement]
    sound: Callable[[Placement], bool]
    least: float = 0.0


Place: TypeAlias = Callable[[PackTask], Placement | None]


def always(shapes: Shapes, options: PackOptions) -> bool:
    """Every packer applies to all charts unless its row says otherwise."""
    return True


@dataclass(frozen=True)
class Packer:
    """The function of a row of ``PACKERS``; called with a task, it places the charts.

    place: PackTask → Placement, or None if it finds none; the caller checks it on the raster. applies:
    whether the packer is worth its time for these charts and options. instant: the packer takes no time, so it
    runs after the deadline too, and its result is only a start.
    """

    place: Place
    applies: Callable[[Shapes, PackOptions], bool] = field(default=always)
    instant: bool = False

    def __call__(self, task: PackTask) -> Placement | None:
        """The placement of a task, None if there is none."""
        return self.place(task)
