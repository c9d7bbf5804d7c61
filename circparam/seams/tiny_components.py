"""Which components are tiny where there are very many, as the floaters of a scan."""

import numpy as np

from circparam.core.arrays import group_sum
from circparam.core.types import BoolArray
from circparam.mesh.surface import Surface
from circparam.seams.multires.decimate import SMALL_COMPONENT

# components: so many tiny ones skip the search; fewer are searched with all others
MANY_COMPONENTS = 200
# of the area of the surface: a tiny component below this share is not searched as a hard one
DEBRIS_AREA_SHARE = 2e-4


def tiny_components(surface: Surface) -> BoolArray:
    """(m,) bool: faces of components with few faces, where the surface has many such components."""
    _, component = surface.components
    tiny = np.bincount(component) <= SMALL_COMPONENT
    if tiny.sum() < MANY_COMPONENTS:
        return np.zeros(len(component), bool)
    return tiny[component]


def debris(surface: Surface) -> BoolArray:
    """(m,) bool: faces of tiny components whose area does not justify asking whether they are hard surfaces."""
    tiny = tiny_components(surface)
    if not tiny.any():
        return tiny
    n, component = surface.components
    share = group_sum(surface.areas, component, n) / surface.areas.sum()
    return tiny & (share <= DEBRIS_AREA_SHARE)[component]
