"""Seams of a coarse surface on the fine one."""

from __future__ import annotations

import numpy as np

from circparam.mesh.atlas import Atlas
from circparam.seams.multires.decimate import decimate
from circparam.seams.multires.transfer_seams import _Router
from circparam.seams.segmentation import grow
from circparam.seams.segmentation.paths import chains_of
from tests.support import shapes
from tests.support.atlases import surface_of


def test_a_vertex_where_a_carried_path_may_end_is_not_moved_again() -> None:
    """Chains that find no path are halved; both halves end at the middle, also when one is halved once more."""
    surface = surface_of(*shapes.torus(60, 30))
    proxy = decimate(surface, 600)
    coarse = Atlas(proxy.surface, np.zeros(len(proxy.surface.edges), bool))
    grow.first_charts(coarse, grow.dual_graph(proxy.surface), 6)
    a, b = (ends[coarse.cut] for ends in coarse.ends)
    fine = Atlas(surface, np.zeros(len(surface.edges), bool))
    nowhere = np.zeros(len(proxy.surface.points), bool)
    chains = chains_of(a, b, len(nowhere), nowhere)
    flat, along = proxy.surface.faces.ravel(), proxy.surface.faces[:, [1, 2, 0]].ravel()
    router = _Router(fine, proxy, (flat, along), nowhere, chains)
    middle = np.unique(chains.vertex)
    router.stand_again(middle, middle)
    stand = router.stand[middle].copy()
    assert np.array_equal(proxy.cell[stand], middle)
    # paths now run through those vertices
    fine.cut = np.isin(fine.ends[0], stand) | np.isin(fine.ends[1], stand)
    router.stand_again(middle, middle)
    assert np.array_equal(router.stand[middle], stand)
