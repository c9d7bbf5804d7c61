"""Charts and layout of a coarse surface on the fine one."""

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.multires.decimate import Proxy
from circparam.seams.multires.transfer_layout import (
    drop_slivers,
    fine_targets,
    nearest_coarse_face,
    prolonged,
    separate,
    take_over,
)
from circparam.seams.segmentation.grow import dual_graph
from circparam.solvers.poisson import from_jacobians
from tests.support import shapes
from tests.support.atlases import cut_between, energies, middles, surface_of

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
    distance = np.linalg.norm(fine.vertex_points[:, None] - coarse.points, axis=2)
    return fine, Proxy(coarse, distance.argmin(1), np.zeros((0, 2), np.int64))


def in_two(surface: Surface, at: float = 0.5) -> Atlas:
    return cut_between(surface, (middles(surface)[:, 0] > at).astype(np.int64))


def test_every_fine_face_has_a_coarse_face_near_it() -> None:
    fine, proxy = sheets()
    near = nearest_coarse_face(fine, proxy)
    centre = middles(proxy.surface)
    away = np.linalg.norm(middles(fine) - centre[near], axis=1)
    assert near.min() >= 0
    assert away.max() < 1.2 / N
    # among the faces round the cell of its first corner none is nearer
    cell = proxy.cell[fine.corner_vertex[:, 0]]
    beside = (proxy.surface.faces[None] == cell[:, None, None]).any(2)
    every = np.linalg.norm(middles(fine)[:, None] - centre, axis=2)
    assert away == pytest.approx(np.where(beside, every, np.inf).min(1))
    assert beside[np.arange(len(near)), near].all()


def test_faces_without_a_cell_have_none_and_those_that_face_away_come_last() -> None:
    fine, proxy = sheets()
    lost = proxy.cell.copy()
    lost[:40] = -1
    near = nearest_coarse_face(fine, Proxy(proxy.surface, lost, proxy.apart))
    assert np.array_equal(near < 0, lost[fine.corner_vertex[:, 0]] < 0)
    # two coarse sheets on each other, one wound the other way: the fine one takes that of its own side
    points, faces = proxy.surface.points, proxy.surface.faces
    twin = Surface(
        points,
        np.r_[faces[:, ::-1], faces],
        np.arange(2 * len(faces)),
        np.zeros(2 * len(faces), bool),
        proxy.surface.edges,
        proxy.surface.locked,
    )
    near = nearest_coarse_face(fine, Proxy(twin, proxy.cell, proxy.apart))
    assert (near >= len(faces)).all()


def test_slivers_are_glued_to_the_neighbour_with_the_longest_common_seam() -> None:
    """A small square in a corner of the left chart, another one on the seam, more of it in the right one."""
    fine, proxy = sheets()
    coarse_chart = in_two(proxy.surface).charts()[1]
    near = nearest_coarse_face(fine, proxy)
    x, y = middles(fine)[:, 0], middles(fine)[:, 1]
    label = (x > 0.5).astype(np.int64)
    label[(x < 0.25) & (y < 0.25)] = 2
    label[(x > 0.375) & (x < 0.75) & (y > 0.375) & (y < 0.625)] = 3
    atlas = cut_between(fine, label)
    assert atlas.charts()[0] == 4
    found = drop_slivers(atlas, coarse_chart, near)
    assert found.real.all()
    n, chart = atlas.charts()
    assert n == 2
    assert np.array_equal(found.chart, chart)
    left, right = chart[label == 0][0], chart[label == 1][0]
    assert left != right
    assert (chart[label == 2] == left).all()
    assert (chart[label == 3] == right).all()
    # good ones are left alone
    good = in_two(fine)
    before = good.cut.copy()
    assert drop_slivers(good, coarse_chart, near).real.all()
    assert np.array_equal(good.cut, before)


def test_charts_whose_seam_was_not_found_are_parted_along_their_labels() -> None:
    fine, proxy = sheets()
    coarse = in_two(proxy.surface)
    _, coarse_chart = coarse.charts()
    near = nearest_coarse_face(fine, proxy)
    atlas = Atlas(fine, np.zeros(len(fine.edges), bool))
    separate(atlas, dual_graph(fine), coarse, coarse_chart, near)
    n, chart = atlas.charts()
    assert n == 2
    x = middles(fine)[:, 0]
    left, right = chart[x < 0.5 - 1 / N], chart[x > 0.5 + 1 / N]
    assert len(np.unique(left)) == len(np.unique(right)) == 1
    assert left[0] != right[0]
    assert 0.99 < fine.edge_lengths[atlas.cut].sum() < 1.3
    # where the seam is there, nothing is added
    good = in_two(fine)
    before = good.cut.copy()
    separate(good, dual_graph(fine), coarse, coarse_chart, near)
    assert np.array_equal(good.cut, before)
    # nor for a small part of another chart: here less than a third of it
    most = in_two(fine, 0.6)
    before = most.cut.copy()
    separate(most, dual_graph(fine), coarse, coarse_chart, near)
    assert np.array_equal(most.cut, before)


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
    found = drop_slivers(atlas, coarse_chart, near)
    carried = fine_targets(coarse, atlas, coarse_chart, near, found)
    assert (coarse_chart[carried.source] == found.main[found.chart]).all()
    cut_mesh = atlas.cut_mesh()
    uv, _ = from_jacobians(cut_mesh, carried.targets)
    assert energies(cut_mesh, uv) == pytest.approx([1.0, 1.0], abs=2e-2 if bend else 1e-9)
    if not bend:  # continued from coarse faces it is the same already, where they lie, too
        start = prolonged(coarse, atlas, cut_mesh, carried.source)
        assert np.abs(np.diff((start - uv)[cut_mesh.faces], axis=1)).max() < 1e-9
        place = coarse.corners[carried.source].mean(1) - start[cut_mesh.faces].mean(1)
        assert np.abs(place).max() < 4 / N
    edge = np.diff(uv[cut_mesh.faces], axis=1)
    own = flat.points[flat.faces][:, :, :2]
    mine = np.where((found.main[found.chart] == 1)[:, None, None], own @ turn, own)
    assert np.abs(edge - np.diff(mine, axis=1)).max() < (0.2 if bend else 1e-6) / N


def test_seams_are_taken_over_only_where_every_corner_is_the_same() -> None:
    """A square with its diagonal turned has as many faces, and each shares two corners with one there was."""
    p, _ = shapes.grid(2, 2)
    one, other = np.array([[0, 1, 3], [0, 3, 2]]), np.array([[0, 1, 2], [1, 3, 2]])
    fine = surface_of(p, one)
    for faces in (one, other):
        coarse = Atlas(surface_of(p, faces), np.ones(1, bool))
        away = np.linalg.norm(fine.vertex_points[:, None] - coarse.surface.points, axis=2)
        proxy = Proxy(coarse.surface, away.argmin(1), np.zeros((0, 2), np.int64))
        atlas = Atlas(fine, np.zeros(len(fine.edges), bool))
        taken = take_over(atlas, coarse, proxy, np.arange(2))
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
