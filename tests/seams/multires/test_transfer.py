"""Charts, seams and layout of a coarse surface on the fine one."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.multires.decimate import Proxy, decimate
from circparam.seams.multires.transfer import carried_over, from_level
from circparam.seams.multires.transfer_layout import (
    drop_slivers,
    nearest_coarse_face,
    prolonged,
    take_over,
)
from circparam.seams.multires.transfer_seams import transfer_seams
from circparam.seams.segmentation import grow
from circparam.seams.segmentation.grow import DualGraph
from circparam.solvers.poisson import from_jacobians
from tests.support import shapes
from tests.support.atlases import cut_between, cut_where, energies, middles, proxy_over, surface_of

N = 8  # cells of the coarse sheet along each side; the fine one has three times as many


def sheets(bend: float = 0.0) -> tuple[Surface, Proxy]:
    """A sheet, and a coarse one over it; the cell of a fine vertex is the nearest coarse one."""
    fine, coarse = (surface_of(*shapes.grid(n + 1, n + 1)) for n in (3 * N, N))
    if bend:
        fine, coarse = (
            surface_of(
                np.stack([np.sin(bend * s.points[:, 0]), s.points[:, 1],
                          np.cos(bend * s.points[:, 0])], 1) / [bend, 1, bend],
                s.faces,
            )
            for s in (fine, coarse)
        )  # fmt: skip
    return fine, proxy_over(fine, coarse)


def in_two(surface: Surface, at: float = 0.5) -> Atlas:
    return cut_between(surface, (middles(surface)[:, 0] > at).astype(np.int64))


@pytest.mark.parametrize("bend", [0.0, 1.2])
def test_the_fine_layout_is_the_coarse_one(bend: float) -> None:
    """Both charts keep shape and direction, on a sheet and on one that is bent."""
    flat, _ = sheets()
    fine, proxy = sheets(bend)
    coarse, atlas = in_two(proxy.surface, 0.4), in_two(fine, 0.4)
    _, coarse_chart = coarse.charts()
    rolled = surface_of(*shapes.grid(N + 1, N + 1))
    turn = np.array([[0.0, 1], [-1, 0]])
    plane = rolled.points[rolled.faces][:, :, :2]
    second = (coarse_chart == 1)[:, None, None]
    coarse.corners = np.where(second, plane @ turn, plane)
    near = nearest_coarse_face(fine, proxy)
    targets, source = carried_over(atlas, DualGraph(fine), coarse, near)
    meant = drop_slivers(atlas, coarse_chart[near])[atlas.charts()[1]]
    assert (coarse_chart[source] == meant).all()
    cut_mesh = atlas.cut_mesh()
    uv, _ = from_jacobians(cut_mesh, targets)
    assert energies(cut_mesh, uv) == pytest.approx([1.0, 1.0], abs=2e-2 if bend else 1e-9)
    if not bend:  # continued from coarse faces it is the same already, where they lie, too
        start = prolonged(coarse, atlas, cut_mesh, source)
        assert np.abs(np.diff((start - uv)[cut_mesh.faces], axis=1)).max() < 1e-9
        place = coarse.corners[source].mean(1) - start[cut_mesh.faces].mean(1)
        assert np.abs(place).max() < 4 / N
    edge = np.diff(uv[cut_mesh.faces], axis=1)
    own = flat.points[flat.faces][:, :, :2]
    mine = np.where((meant == 1)[:, None, None], own @ turn, own)
    assert np.abs(edge - np.diff(mine, axis=1)).max() < (0.2 if bend else 1e-6) / N


def test_a_sliver_joins_the_neighbour_with_the_longest_common_seam() -> None:
    """A strip along the middle stands for no coarse chart: more of its seam lies in the left half."""
    fine, _ = sheets()
    x, y = middles(fine)[:, :2].T
    half = (x > 0.5).astype(np.int64)
    strip = (x < 0.5) & (x > 0.5 - 2 / (3 * N)) & (np.abs(y - 0.5) < 0.25)
    atlas = cut_between(fine, np.where(strip, 2, half))
    assert atlas.charts()[0] == 3
    assert drop_slivers(atlas, half).tolist() == [0, 1]
    assert np.array_equal(atlas.cut, cut_between(fine, half).cut)


def test_seams_are_taken_over_only_where_every_corner_is_the_same() -> None:
    """A square with its diagonal turned has as many faces, and each shares two corners with one there was."""
    p, _ = shapes.grid(2, 2)
    one, other = np.array([[0, 1, 3], [0, 3, 2]]), np.array([[0, 1, 2], [1, 3, 2]])
    fine = surface_of(p, one)
    for faces in (one, other):
        coarse = Atlas(surface_of(p, faces), np.ones(1, bool))
        atlas = Atlas(fine, np.zeros(len(fine.edges), bool))
        taken = take_over(atlas, coarse, proxy_over(fine, coarse.surface), np.arange(2))
        assert taken.all() if faces is one else not taken.any()
        assert atlas.cut.all() if faces is one else not atlas.cut.any()


def test_a_seam_on_one_side_is_a_seam_on_both() -> None:
    """Four pages on one spine, joined in other pairs on the proxy: 0 with 1 here, 0 with 3 there."""
    angle = np.arange(4) * np.pi / 2
    rim = np.stack([np.cos(angle), np.sin(angle), np.full(4, 0.5)], 1)
    p = np.concatenate([[[0.0, 0, 0], [0, 0, 1]], rim])
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]])

    def book(*pairs: tuple[int, int]) -> Surface:
        none = np.zeros(4, bool)
        return Surface(p, faces, np.arange(4), none, np.array(pairs), np.zeros(2, bool))

    fine, coarse = book((0, 3), (6, 9)), Atlas(book((0, 9), (3, 6)), np.array([False, True]))
    cell = np.zeros(int(fine.corner_vertex.max()) + 1, np.int64)
    cell[fine.corner_vertex] = faces
    atlas = Atlas(fine, np.zeros(2, bool))
    assert take_over(
        atlas, coarse, Proxy(coarse.surface, cell, np.zeros((0, 2))), np.arange(4)
    ).all()
    assert atlas.cut.all()


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


def test_seams_reach_a_boundary_that_lies_outside_that_of_the_proxy() -> None:
    """Inner vertices are nearest to its boundary points; a seam that ended in one would part nothing."""
    fine, proxy = sheets()
    points, faces = proxy.surface.points, proxy.surface.faces
    proxy = proxy_over(fine, surface_of(0.8 * points + [0.1, 0.1, 0.0], faces))
    atlas = Atlas(fine, np.zeros(len(fine.edges), bool))
    assert transfer_seams(in_two(proxy.surface), proxy, atlas) == 0
    assert atlas.charts()[0] == 2


def test_components_that_a_level_leaves_as_they_are_keep_what_they_have() -> None:
    """A closed ball in two halves, its uv wherever they are, beside a torus that gets smaller."""
    ball = shapes.icosphere(1)
    surface = surface_of(*shapes.join(shapes.torus(40, 20), (ball[0] + 9, ball[1])))
    level = decimate(surface, 800)
    far, high = (middles(level.surface)[:, [0, 2]] > [5, 9]).T
    assert far.sum() == len(ball[1])
    # of the torus each face is a chart, as it lies
    coarse = cut_between(level.surface, np.where(far, -1 - high, np.arange(len(far))))
    coarse.corners = level.surface.rest_triangles.copy()
    cut_mesh = coarse.cut_mesh()
    anywhere = np.random.default_rng(0).normal(size=(cut_mesh.n_vertices, 2))
    coarse.corners[far] = anywhere[cut_mesh.faces[far]]
    near = nearest_coarse_face(surface, level)
    fine = from_level(surface, DualGraph(surface), coarse, level, near)
    same = middles(surface)[:, 0] > 5
    assert np.array_equal(fine.corners[same], coarse.corners[near[same]])
    halves = middles(surface)[surface.edges // 3, 2] > 9
    inside = same[surface.sides[0]]
    assert np.array_equal(fine.cut[inside], (halves[:, 0] != halves[:, 1])[inside])
