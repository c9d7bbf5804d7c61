"""What two ways of charting a component are compared by, and when one need not be gone to its end."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.records import dataclass
from circparam.mesh.atlas import Atlas
from circparam.seams.cost import COST
from circparam.seams.hard.regions import seam_prices

# times the cost of the other way: starts that cost more when they have merged do not win any more. Of 37 meshes
# what came of the starts in the end cost 0.7 of them at least, and those that won had cost 0.95 at most
HOPELESS = 1.4


class Outdone(Exception):  # noqa: N818
    """Charts that are being decided cost so much more than others at hand that they will not be taken."""


@dataclass(frozen=True, eq=False)
class Rival:
    """An atlas of the same surface that other charts have to beat, component by component.

    cost: (components,) as ``AtlasCost.of_components`` has it, in this unit. faces: their number.
    """

    cost: FloatArray
    unit: float
    faces: int

    @staticmethod
    def of(atlas: Atlas, unit: float) -> Rival:
        """unit: length that counts as 1, the root of the area of all that is compared."""
        cost = COST.of_components(atlas, atlas.flat, unit)
        return Rival(cost, unit, len(atlas.surface.faces))

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
        costs = [COST.of_components(one, flat, self.unit) for one in merged]
        if (np.min(costs, axis=0) > HOPELESS * self.cost).all():
            raise Outdone
