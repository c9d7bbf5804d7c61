"""Placements of all charts, and the task of a packer: the common data of all packers."""

from collections.abc import Callable, Mapping
from dataclasses import field

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
    monitor: Monitor = field(default_factory=Monitor)
    found: Mapping[str, Placement] = field(default_factory=dict)
    sound: Callable[[Placement], bool] = lambda placement: True
    least: float = 0.0

    @property
    def reached(self) -> float:
        """The largest scale that another packer has reached, or that is asked for; 0 for none."""
        return max(self.least, *(placement.scale for placement in self.found.values()), 0.0)


@dataclass(frozen=True)
class Packer:
    """The function of a row of ``PACKERS``; called with a task, it places the charts.

    place: PackTask → Placement, or None if it finds none; the caller checks it on the raster. applies:
    whether the packer is worth its time for these charts and options. instant: the packer takes no time, so it
    runs after the deadline too, and its result is only a start.
    """

    place: Callable[[PackTask], Placement | None]
    applies: Callable[[Shapes, PackOptions], bool] = lambda shapes, options: True
    instant: bool = False

    def __call__(self, task: PackTask) -> Placement | None:
        """The placement of a task, None if there is none."""
        return self.place(task)
