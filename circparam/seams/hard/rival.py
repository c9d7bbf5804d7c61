"""What two ways of charting a component are compared by, and when one need not be gone to its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, group_sum
from circparam.mesh.atlas import Atlas
from circparam.seams.hard.regions import seam_prices

EYESORE = 4.0  # what a seam in a flat counts on top of its length when two atlases are compared
# times the cost of the other way: starts that cost more when they have merged do not win any more. Of 37 meshes
# what came of the starts in the end cost 0.7 of them at least, and those that won had cost 0.95 at most
HOPELESS = 1.4


class Outdone(Exception):  # noqa: N818
    """Charts that are being decided cost so much more than others at hand that they will not be taken."""


def component_costs(
    atlas: Atlas, flat: BoolArray | None, unit: float, chart_cost: float
) -> FloatArray:
    """(components,) what an atlas costs: seams over ``unit``, those in flats more, and so much a chart.

    flat: (e,) bool, edges inside flats; None where there are none.
    """
    surface = atlas.surface
    n, component = surface.components
    on = surface.edges[atlas.cut, 0] // 3
    length = surface.edge_lengths[atlas.cut] / unit
    if flat is not None:
        length = length * (1 + EYESORE * flat[atlas.cut])
    _, first = np.unique(atlas.charts()[1], return_index=True)
    seam: FloatArray = group_sum(length, component[on], n)
    return seam + chart_cost * np.bincount(component[first], minlength=n)


@dataclass(frozen=True, eq=False)
class Rival:
    """An atlas of the same surface that other charts have to beat, component by component.

    cost: (components,) as ``component_costs`` has it, with this unit and cost of a chart. faces: their number.
    """

    cost: FloatArray
    unit: float
    chart_cost: float
    faces: int

    @staticmethod
    def of(atlas: Atlas, unit: float, chart_cost: float) -> Rival:
        """unit: length that counts as 1, the root of the area of all that is compared."""
        cost = component_costs(atlas, atlas.flat, unit, chart_cost)
        return Rival(cost, unit, chart_cost, len(atlas.surface.faces))

    def face(self, merged: list[Atlas]) -> None:
        """Raise Outdone where none of those atlases is likely to come below it in any component.

        merged: starts whose charts have merged, of the surface or of a proxy of its one component. On a proxy
        of several nobody knows which is which: they are gone on with.
        """
        surface = merged[0].surface
        n, _ = surface.components
        if n != len(self.cost) or (n > 1 and len(surface.faces) != self.faces):
            return
        flat = seam_prices(surface).flat
        costs = [component_costs(one, flat, self.unit, self.chart_cost) for one in merged]
        if (np.min(costs, axis=0) > HOPELESS * self.cost).all():
            raise Outdone
