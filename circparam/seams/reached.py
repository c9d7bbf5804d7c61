"""What a search for charts has reached: its answer where time runs out before the search ends.

A search hands sound atlases of parts of its surface to ``Monitor.keep`` as it goes. The cheapest of each
component is kept, so that a longer time never gives a worse one.
"""

from collections.abc import Callable

import numpy as np

from circparam.core.monitor import Monitor
from circparam.errors import OutOfTimeError
from circparam.mesh.atlas import Atlas
from circparam.mesh.halfedge import sides_apart
from circparam.mesh.surface import Surface
from circparam.seams.cost import COST

# cost that a layout has besides, which may have charts that flip or overlap: above all others, and half of the
# digits are left to compare two such layouts
UNSOUND = float(1 / np.sqrt(np.finfo(float).eps))


def in_time(
    surface: Surface, search: Callable[[], Atlas], monitor: Monitor, partly: bool = False
) -> Atlas:
    """What a search gives for a surface; where time runs out before its end, what it has reached.

    Raises OutOfTimeError where a component is missing in that. partly: only where all are; components that are
    missing have no uv (NaN).
    """
    reached = Reached(surface)
    try:
        with monitor.keeping(reached.keep):
            return search()
    except OutOfTimeError:
        there = np.isfinite(reached.cost)
        if not (there.any() if partly else there.all()):
            raise
        monitor.late = True
        return reached.atlas()


class Reached:
    """The cheapest atlas so far of each component of a surface.

    cost: (components,) by ``AtlasCost.of_components``, infinite where there is none yet.
    """

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        self._by_source = np.argsort(surface.source)  # faces enter a search by their position
        count, component = surface.components
        self._size = np.bincount(component, minlength=count)
        self._chart = np.full(len(surface.faces), -1)
        self._corners = np.full((len(surface.faces), 3, 2), np.nan)
        self.cost = np.full(count, np.inf)

    def keep(self, atlas: Atlas, sound: bool = True) -> None:
        """Take over the components of an atlas that are cheaper than what is there.

        The atlas may be of a part of the surface. One of another surface, such as a proxy, is left alone.
        """
        part, whole = atlas.surface, self._surface
        place = np.searchsorted(whole.source, part.source, sorter=self._by_source)
        face = self._by_source[place.clip(max=len(whole.source) - 1)]
        if part.points is not whole.points or (whole.source[face] != part.source).any():
            return
        count, component = part.components
        _, first = np.unique(component, return_index=True)
        there = whole.components[1][face[first]]
        complete = np.bincount(component, minlength=count) == self._size[there]
        cost = COST.of_components(atlas, atlas.flat) + (0 if sound else UNSOUND)
        better = complete & (cost < self.cost[there])
        taken = better[component]
        self.cost[there[better]] = cost[better]
        self._corners[face[taken]] = atlas.corners[taken]
        self._chart[face[taken]] = self._chart.max() + 1 + atlas.charts()[1][taken]

    def atlas(self) -> Atlas:
        """The atlas of all components: cut between charts, and where the two sides of an edge lie apart."""
        surface = self._surface
        left, right = surface.sides
        known = np.isfinite(self._corners.reshape(-1, 2)[surface.edges[:, 0]]).all(1)
        between = self._chart[left] != self._chart[right]
        cut = between | (sides_apart(self._corners, surface.edges) & known)
        return Atlas(surface, cut & ~surface.locked, self._corners)
