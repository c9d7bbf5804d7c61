"""When charts that are being decided are given up for others that are at hand."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.cost import COST
from circparam.seams.hard.regions import seam_prices, turns
from circparam.seams.hard.rival import HOPELESS, Outdone, Rival
from tests.support import shapes
from tests.support.atlases import surface_of


def cubes(count: int) -> tuple[Surface, Atlas]:
    """Cubes side by side, cut along all their edges."""
    surface = surface_of(*shapes.row_of(shapes.cube(3), count))
    cut = turns(surface)[0] > 1
    return surface, Atlas(surface, cut, prices=seam_prices(surface))


def test_the_cost_of_a_component_is_that_of_its_own_seams_and_charts() -> None:
    """Two cubes of six charts and twelve edges each, of which none lies in a flat; then one that does."""
    surface, atlas = cubes(2)
    cost = COST.of_components(atlas, atlas.flat, 2.0)
    assert cost == pytest.approx([12 / 2 + 6 * COST.chart] * 2)
    second = surface.components[1][surface.edges[:, 0] // 3] == 1
    assert atlas.flat is not None
    inner = np.flatnonzero(atlas.flat & second)[0]
    atlas.cut[inner] = True
    length = float(surface.edge_lengths[inner]) / 2
    more = COST.of_components(atlas, atlas.flat, 2.0)
    assert more - cost == pytest.approx([0, (1 + COST.flat) * length])
    assert COST.of_components(atlas, None, 2.0) - cost == pytest.approx([0, length])


@pytest.mark.parametrize("count", [1, 2])
def test_a_search_is_given_up_where_each_component_is_far_behind(count: int) -> None:
    _, atlas = cubes(count)
    cost = COST.of_components(atlas, atlas.flat, 1.0)
    Rival(cost / HOPELESS * 1.01, 1.0, len(atlas.surface.faces)).face([atlas])
    ahead = cost / HOPELESS * 0.99
    with pytest.raises(Outdone):
        Rival(ahead, 1.0, len(atlas.surface.faces)).face([atlas])
    ahead[0] = cost[0]  # that one may win yet
    Rival(ahead, 1.0, len(atlas.surface.faces)).face([atlas])


def test_components_of_a_proxy_are_not_taken_for_each_other() -> None:
    """Of one component a proxy tells; of several it may have them in any order, or fewer."""
    for count, told in ((1, True), (2, False)):
        _, atlas = cubes(count)
        nothing = Rival(np.full(count, 1e-3), 1.0, 5000)
        if told:
            with pytest.raises(Outdone):
                nothing.face([atlas])
        else:
            nothing.face([atlas])
    _, atlas = cubes(2)
    Rival(np.full(3, 1e-3), 1.0, len(atlas.surface.faces)).face([atlas])
