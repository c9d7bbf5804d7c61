"""Seams of a coarse surface on the fine one."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.multires.decimate import Proxy, decimate
from circparam.seams.multires.transfer_seams import transfer_seams
from circparam.seams.segmentation import grow
from tests.support import shapes
from tests.support.atlases import cut_between, cut_where, middles, proxy_over, surface_of


def sheets(n: int = 6, times: int = 3) -> tuple[Surface, Proxy]:
    fine, coarse = (surface_of(*shapes.grid(k + 1, k + 1)) for k in (times * n, n))
    return fine, proxy_over(fine, coarse)


@pytest.mark.parametrize("count", [2, 6, 14])
def test_charts_of_a_proxy_stay_as_many_on_the_fine_surface(count: int) -> None:
    """On a torus, its proxy by decimation: chains of any length, closed ones among them."""
    surface = surface_of(*shapes.torus(40, 20))
    proxy = decimate(surface, 500)
    coarse = Atlas(proxy.surface, np.zeros(len(proxy.surface.edges), bool))
    grow.first_charts(coarse, grow.DualGraph(proxy.surface), count)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    assert transfer_seams(coarse, proxy, atlas) == 0
    sizes = np.bincount(atlas.charts()[1])
    assert (sizes > 20).sum() == coarse.charts()[0]
    ratio = atlas.seam_length / coarse.seam_length
    assert 0.6 < ratio < 1.3
    # seams end nowhere but in each other
    a, b = atlas.ends
    assert (np.bincount(np.r_[a[atlas.cut], b[atlas.cut]]) != 1).all()


def test_locked_edges_are_gone_round() -> None:
    """The straight way is locked but for its ends: the path finds another, through cells beside."""
    fine, proxy = sheets()
    coarse = cut_between(proxy.surface, (middles(proxy.surface)[:, 0] > 0.5).astype(np.int64))
    x, y = fine.points[:, 0], fine.points[:, 1]
    locked = cut_where(fine, (np.abs(x - 0.5) < 1e-9) & (y > 0.1) & (y < 0.9))
    assert locked.any()
    fine = dataclasses.replace(fine, locked=locked)
    atlas = Atlas(fine, np.zeros(len(fine.edges), bool))
    assert transfer_seams(coarse, proxy, atlas) == 0
    assert not (atlas.cut & locked).any()
    assert atlas.charts()[0] == 2
    assert 1.0 < fine.edge_lengths[atlas.cut].sum() < 1.6
