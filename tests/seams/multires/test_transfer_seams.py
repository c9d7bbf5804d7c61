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
from tests.support.atlases import cut_between, cut_where, middles, surface_of


def proxy_over(fine: Surface, coarse: Surface) -> Proxy:
    """The cell of a fine vertex is the nearest coarse one."""
    distance = np.linalg.norm(fine.vertex_points[:, None] - coarse.points, axis=2)
    return Proxy(coarse, distance.argmin(1), np.zeros((0, 2), np.int64))


def sheets(n: int = 6, times: int = 3) -> tuple[Surface, Proxy]:
    fine, coarse = (surface_of(*shapes.grid(k + 1, k + 1)) for k in (times * n, n))
    return fine, proxy_over(fine, coarse)


def quarters(surface: Surface) -> np.ndarray:
    x, y = middles(surface)[:, :2].T
    return (x > 0.5).astype(np.int64) + 2 * (y > 0.5)


def points_on(atlas: Atlas) -> np.ndarray:
    return atlas.surface.vertex_points[
        np.unique(np.concatenate([e[atlas.cut] for e in atlas.ends]))
    ]


def test_a_straight_seam_is_carried_over_as_it_is() -> None:
    fine, proxy = sheets()
    coarse = cut_between(proxy.surface, (middles(proxy.surface)[:, 0] > 0.5).astype(np.int64))
    atlas = Atlas(fine, np.ones(len(fine.edges), bool))
    assert transfer_seams(coarse, proxy, atlas) == 0
    assert fine.edge_lengths[atlas.cut].sum() == pytest.approx(1.0)
    assert (np.abs(points_on(atlas)[:, 0] - 0.5) < 1e-9).all()
    # and none is none
    coarse.cut[:] = False
    assert transfer_seams(coarse, proxy, atlas) == 0
    assert not atlas.cut.any()


def test_seams_join_the_same_junctions_and_part_the_same_charts() -> None:
    fine, proxy = sheets()
    label = quarters(proxy.surface)
    coarse = cut_between(proxy.surface, label)
    atlas = Atlas(fine, np.zeros(len(fine.edges), bool))
    assert transfer_seams(coarse, proxy, atlas) == 0
    n, chart = atlas.charts()
    assert n == 4
    away = np.abs(middles(fine)[:, :2] - 0.5).min(1) > 0.2
    pairs = np.unique(np.c_[chart, quarters(fine)][away], axis=0)
    assert len(pairs) == 4
    a, b = atlas.ends
    valence = np.bincount(np.r_[a[atlas.cut], b[atlas.cut]])
    crossing = np.flatnonzero(valence > 2)
    assert fine.vertex_points[crossing] == pytest.approx(np.array([[0.5, 0.5, 0]]), abs=0.1)


@pytest.mark.parametrize("count", [2, 6, 14])
def test_charts_of_a_proxy_stay_as_many_on_the_fine_surface(count: int) -> None:
    """On a torus, its proxy by decimation: chains of any length, closed ones among them."""
    surface = surface_of(*shapes.torus(40, 20))
    proxy = decimate(surface, 500)
    coarse = Atlas(proxy.surface, np.zeros(len(proxy.surface.edges), bool))
    grow.first_charts(coarse, grow.dual_graph(proxy.surface), count)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    assert transfer_seams(coarse, proxy, atlas) == 0
    sizes = np.bincount(atlas.charts()[1])
    assert (sizes > 20).sum() == coarse.charts()[0]
    ratio = atlas.seam_length / coarse.seam_length
    assert 0.6 < ratio < 1.3
    # seams end nowhere but in each other
    a, b = atlas.ends
    assert (np.bincount(np.r_[a[atlas.cut], b[atlas.cut]]) != 1).all()


def test_chains_in_cells_without_a_way_count_as_not_found() -> None:
    """No fine vertex stands for the coarse ones of a seam: there is nothing to cut."""
    fine, proxy = sheets()
    coarse = cut_between(proxy.surface, (middles(proxy.surface)[:, 0] > 0.5).astype(np.int64))
    lost = Proxy(proxy.surface, np.full(len(proxy.cell), -1), proxy.apart)
    atlas = Atlas(fine, np.zeros(len(fine.edges), bool))
    assert transfer_seams(coarse, lost, atlas) >= 1
    assert not atlas.cut.any()


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


def test_edges_apart_are_seams_as_well() -> None:
    """Coarse edges of several faces are no inner edges; the fine surface is cut there."""
    fine, proxy = sheets()
    index = np.arange(49).reshape(7, 7)
    column = index[3]
    torn = Proxy(proxy.surface, proxy.cell, np.stack([column[:-1], column[1:]], 1))
    coarse = Atlas(proxy.surface, np.zeros(len(proxy.surface.edges), bool))
    atlas = Atlas(fine, np.zeros(len(fine.edges), bool))
    assert transfer_seams(coarse, torn, atlas) == 0
    assert (np.abs(points_on(atlas)[:, 0] - 0.5) < 1e-9).all()
    assert fine.edge_lengths[atlas.cut].sum() >= 1 - 2 / 18 - 1e-9
