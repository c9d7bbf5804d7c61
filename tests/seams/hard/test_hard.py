"""Hard surfaces: seams stay out of flats, tubes unroll whole, and nothing changes for organic shapes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.geometry.distortion import best_chart_scales, measure
from circparam.geometry.overlap import overlaps, self_overlapping, signs
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.surface import Surface
from circparam.seams import SEAMS
from circparam.seams import charts as module
from circparam.seams.hard.charts import take_better, uncoiled
from circparam.seams.hard.copies import find_copies
from circparam.seams.hard.fit import composed
from circparam.seams.hard.regions import (
    DOUBTFUL,
    HARD,
    ORGANIC,
    flats,
    hardness,
    seam_prices,
    sure_normals,
    turns,
)
from circparam.seams.hard.unroll import layers, slits, straight, unroll
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.layout import judge
from circparam.seams.segmentation.unions import _turns
from circparam.solvers.newton import RelaxOptions, relax
from tests.support import shapes
from tests.support.parts import PARTS, Part, circle, extrude, lathe, rectangle, rounded_box, shaken


def surface_of(points, faces) -> Surface:
    return repair(Mesh(points, faces))[0]


def energy(cut_mesh, uv) -> np.ndarray:
    """(n_charts,) symmetric Dirichlet energy / 4."""
    return relax(cut_mesh, uv, RelaxOptions(max_iterations=0)).energy


def atlas_of(part: Part, bound: float = 1.05) -> tuple[Surface, Atlas]:
    """The charts of a part, checked for everything that is promised of any."""
    surface = surface_of(part.points, part.faces)
    seams = SEAMS["charts"].function(surface, SeamOptions(max_distortion=bound), Monitor())
    atlas = Atlas(surface, seams.cut, seams.uv)
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    assert np.array_equal(uv[cut_mesh.faces], seams.uv)
    assert not not_disks(cut_mesh).any()
    assert (signs(uv, cut_mesh.faces) > 0).all()
    found = overlaps(cut_mesh.faces, uv, cut_mesh.chart, cut_mesh.edges)
    assert not found.self_overlapping.any()
    scaled = uv * best_chart_scales(cut_mesh, uv)[cut_mesh.vertex_chart][:, None]
    assert measure(cut_mesh, scaled).sd_max_chart <= bound
    return surface, atlas


def check_whole(part: Part, bound: float = 1.05) -> Atlas:
    """No seam runs inside a flat, and each flat and tube is in one chart."""
    surface, atlas = atlas_of(part, bound)
    label = part.surface[surface.source]
    ends = label[surface.edges // 3]
    inside = (ends[:, 0] == ends[:, 1]) & part.flat[ends[:, 0]]
    assert inside.any()
    assert not atlas.cut[inside].any()
    _, chart = atlas.charts()
    for k in np.flatnonzero(part.flat | part.tube):
        assert len(np.unique(chart[label == k])) == 1
    return atlas


@pytest.mark.parametrize("name", PARTS)
def test_flats_and_tubes_of_parts_stay_whole(name) -> None:
    check_whole(PARTS[name]())


@pytest.mark.parametrize("bound", [1.05, 1.01])
def test_flats_of_a_part_without_any_sharp_edge_stay_whole(bound) -> None:
    part = rounded_box()
    assert (hardness(surface_of(part.points, part.faces)) == DOUBTFUL).all()
    check_whole(part, bound)


@pytest.mark.parametrize("name", ["plate", "gear", "bracket"])
def test_a_tight_bound_does_not_cut_flats_either(name) -> None:
    check_whole(PARTS[name](), 1.002)


@pytest.mark.parametrize("name", ["plate", "flanged pipe", "letters"])
@pytest.mark.parametrize("scale", [1e-3, 25.4])
def test_noise_of_single_precision_and_units_cut_no_flat(name, scale) -> None:
    part = shaken(PARTS[name](), 1e-7)
    check_whole(Part(part.points * scale, part.faces, part.surface, part.flat, part.tube))


@settings(max_examples=15, deadline=None)
@given(
    st.integers(0, 3), st.integers(5, 40), st.floats(0.05, 0.4), st.floats(0.1, 3.0), st.booleans()
)
def test_plates_with_any_holes_stay_whole(holes, around, radius, height, sunk) -> None:
    """Also where pockets take the place of one hole."""
    loops = [circle(around, radius, x) for x in (-1.2, 0.0, 1.2)[:holes]]
    pockets = [(loops.pop(), height / 3)] if sunk and loops else []
    check_whole(extrude(rectangle(4.0, 1.5), loops, height, pockets))


def test_a_tube_is_unrolled_along_a_straight_line() -> None:
    """An open tube of quads in rings: one slit from end to end, as long as the tube, and no distortion."""
    surface = surface_of(*shapes.cylinder(around=24, along=6, height=2.0))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool), prices=seam_prices(surface))
    atlas.cut |= slits(atlas)
    assert surface.edge_lengths[atlas.cut].sum() == pytest.approx(2.0)
    cut_mesh = atlas.cut_mesh()
    uv = unroll(cut_mesh)
    assert energy(cut_mesh, uv) == pytest.approx([1.0], abs=1e-9)
    size = np.sort(np.ptp((uv - uv.mean(0)) @ np.linalg.svd(uv - uv.mean(0))[2].T, axis=0))
    assert size == pytest.approx([2.0, 24 * 2 * np.sin(np.pi / 24)], rel=1e-6)


def test_holes_in_a_plane_need_no_slit_and_cone_tips_do() -> None:
    plane = surface_of(*shapes.annulus())
    atlas = Atlas(plane, np.zeros(len(plane.edges), bool), prices=seam_prices(plane))
    assert not slits(atlas).any()
    cone = surface_of(*shapes.cone())
    atlas = Atlas(cone, np.zeros(len(cone.edges), bool), prices=seam_prices(cone))
    atlas.cut |= slits(atlas)
    cut_mesh = atlas.cut_mesh()
    assert energy(cut_mesh, unroll(cut_mesh)) == pytest.approx([1.0], abs=1e-9)


def coil(turns_: float = 2.5, n: int = 200, width: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """The flank of a screw: a strip that unrolls to a ring it runs through more than once."""
    t = np.linspace(0, 2 * np.pi * turns_, n)
    rim = [np.stack([r * np.cos(t), r * np.sin(t), 0.02 * t], 1) for r in (1.0, 1.0 + width)]
    k = np.arange(n - 1)
    faces = np.concatenate([np.stack([k, n + k, n + k + 1], 1), np.stack([k, n + k + 1, k + 1], 1)])
    return np.concatenate(rim), faces


def test_a_coil_is_laid_straight() -> None:
    surface = surface_of(*coil())
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    uv = unroll(cut_mesh)
    assert self_overlapping(cut_mesh, uv).all()
    assert layers(cut_mesh, uv).tolist() == [3]
    assert not self_overlapping(cut_mesh, straight(cut_mesh)).any()
    laid = uncoiled(judge(cut_mesh, uv), np.ones(1, bool), 1.05)
    assert not laid.bad(1.05).any()
    assert laid.energy == pytest.approx(energy(cut_mesh, laid.uv))
    # and where the bound does not allow it, what was there stays
    again = uncoiled(judge(cut_mesh, uv), np.ones(1, bool), 1.0 + 1e-5)
    assert np.array_equal(again.uv, uv)
    assert again.overlapping.all()


def test_layouts_that_fit_along_a_hinge_are_joined_exactly() -> None:
    """Two sides of a box, each laid out somewhere: moved together they are the box untangled."""
    part = extrude(rectangle(1.0, 1.0))
    surface = surface_of(part.points, part.faces)
    label = part.surface[surface.source]
    angle, _ = turns(surface)
    two = np.isin(label, [0, 2])
    sides = surface.part(two)
    cut = np.zeros(len(sides.edges), bool)
    apart = Atlas(sides, turns(sides)[0] > 1)
    cut_mesh = apart.cut_mesh()
    uv = unroll(cut_mesh)
    rotation = shapes.rotation(3)[:2, :2]
    rotation = np.linalg.svd(rotation)[0]
    rotation[0] *= np.sign(np.linalg.det(rotation))
    moved = cut_mesh.vertex_chart == 1
    uv[moved] = uv[moved] @ rotation + [3.0, -2.0]
    joined = sides.cut_mesh(cut)
    right = cut_mesh.chart == 1
    turn = _turns(joined, uv[cut_mesh.faces], right)
    together, value, parts = composed(joined, uv[cut_mesh.faces], right, turn)
    assert (angle > 1).any()
    assert parts == pytest.approx([1.0])
    assert value == pytest.approx([1.0])
    assert not self_overlapping(joined, together).any()


def test_slivers_have_the_normals_of_what_they_lie_in() -> None:
    """Points on the edge between two triangles of a flat, off it by less than single precision can tell."""
    rng = np.random.default_rng(0)
    n = 12
    x = np.linspace(0, 1, n)
    low = np.stack([x, 0 * x, 0 * x], 1)
    high = low + [0, 1e-7, 0] + 1e-7 * rng.uniform(-1, 1, (n, 3)) * [0, 0, 1]
    top, bottom = [[0.5, 1.0, 0.0]], [[0.5, -1.0, 0.0]]
    points = np.concatenate([low, high, top, bottom])
    k = np.arange(n - 1)
    faces = np.concatenate(
        [
            np.stack([k, k + 1, n + k + 1], 1),
            np.stack([k, n + k + 1, n + k], 1),
            np.stack([n + k, n + k + 1, 0 * k + 2 * n], 1),
            np.stack([k + 1, k, 0 * k + 2 * n + 1], 1),
        ]
    )
    surface = Surface(
        points,
        faces,
        np.arange(len(faces)),
        np.zeros(len(faces), bool),
        surface_of(points, faces).edges,
        np.zeros(len(surface_of(points, faces).edges), bool),
    )
    assert surface.normals[:, 2].min() < 0.9
    assert sure_normals(surface)[:, 2] == pytest.approx(np.ones(len(faces)), abs=1e-6)
    label, _ = flats(surface, turns(surface)[0])
    assert label.max() == 0


def test_a_fine_tube_is_not_a_flat() -> None:
    """Its faces turn less than flats do, one by one."""
    surface = surface_of(*shapes.cylinder(around=900, along=1))
    angle, _ = turns(surface)
    assert angle.max() < np.radians(0.5)
    label, _ = flats(surface, angle)
    assert label.max() > 100


@pytest.mark.parametrize("name", PARTS)
def test_parts_are_hard(name) -> None:
    part = PARTS[name]()
    assert (hardness(surface_of(part.points, part.faces)) == HARD).all()


@pytest.mark.parametrize(
    "shape",
    [
        shapes.icosphere(3),
        shapes.torus(48, 32),
        shapes.bumped_disk(),
        shapes.noisy(*shapes.icosphere(4), amount=0.05),
        shapes.double_torus(),
    ],
)
def test_round_shapes_are_organic(shape) -> None:
    assert (hardness(surface_of(*shape)) == ORGANIC).all()


def test_a_round_shape_of_few_faces_is_not_taken_for_a_hard_one() -> None:
    assert (hardness(surface_of(*shapes.icosphere(1))) != HARD).all()


def test_organic_components_are_laid_out_as_without_the_hard_ones() -> None:
    """A sphere beside a plate gets the seams it has alone."""
    ball = shapes.noisy(*shapes.icosphere(3), amount=0.02)
    part = PARTS["plate"]()
    both = surface_of(*shapes.join(ball, (part.points + np.array([5.0, 0, 0]), part.faces)))
    alone = surface_of(*ball)
    find = SEAMS["charts"].function
    together = find(both, SeamOptions(), Monitor())
    single = find(alone, SeamOptions(), Monitor())
    sphere = (hardness(both) == ORGANIC)[both.edges[:, 0] // 3]
    assert np.array_equal(together.cut[sphere], single.cut)


def test_organic_shapes_do_not_go_the_way_of_hard_ones(monkeypatch) -> None:
    def never(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(module, "hard_atlas", never)
    surface = surface_of(*shapes.bumped_disk())
    module.charts(surface, SeamOptions(), Monitor())


def test_of_two_atlases_each_component_takes_the_better(monkeypatch) -> None:
    """Two cubes: one atlas cuts all edges of the first, the other those of the second."""
    part = PARTS["cube"]()
    pair = shapes.join((part.points, part.faces), (part.points + 3.0, part.faces))
    surface = surface_of(*pair)
    first = surface.points[surface.faces[surface.edges[:, 0] // 3, 0], 0] < 2
    sharp = turns(surface)[0] > 1
    one = Atlas(surface, sharp & first)
    other = Atlas(surface, sharp & ~first, prices=seam_prices(surface))
    take_better(one, np.ones(len(surface.faces), bool), other, 0.25)
    assert not one.cut.any()


def test_doubtful_components_end_no_worse_than_either_way(monkeypatch) -> None:
    surface = surface_of(*shapes.icosphere(1))
    monkeypatch.setattr(module, "hardness", lambda s: np.full(len(s.faces), DOUBTFUL))
    both = module.charts(surface, SeamOptions(), Monitor())
    costs = []
    for kind in (ORGANIC, HARD):
        monkeypatch.setattr(module, "hardness", lambda s, kind=kind: np.full(len(s.faces), kind))
        costs.append(cost(surface, module.charts(surface, SeamOptions(), Monitor()).cut))
    assert cost(surface, both.cut) == pytest.approx(min(costs))


def cost(surface: Surface, cut: np.ndarray) -> float:
    """Seam length and a quarter for every chart."""
    atlas = Atlas(surface, cut)
    return atlas.seam_length + 0.25 * atlas.charts()[0]


def test_a_flanged_pipe_keeps_the_number_of_its_charts_whatever_its_tubes_have() -> None:
    """Finer tubes are the same model: as many charts, and seams as long."""
    found = []
    for n in (32, 96):
        profile = np.array([[0.5, 0], [1, 0], [1, 0.2], [0.6, 0.2], [0.6, 2], [0.5, 2]])
        atlas = check_whole(lathe(profile, n))
        found.append((atlas.charts()[0], atlas.seam_length))
    assert abs(found[0][0] - found[1][0]) <= 2
    assert found[0][1] == pytest.approx(found[1][1], rel=0.25)


def test_seams_are_dear_in_flats_and_cheap_on_sharp_edges() -> None:
    """And on concave ones cheaper still: the floor of a pocket against the rim of the plate."""
    part = extrude(rectangle(4.0, 2.0), (), 1.0, [(circle(48, 0.5), 0.5)])
    surface = surface_of(part.points, part.faces)
    prices = seam_prices(surface)
    kind = np.sort(part.surface[surface.source][surface.edges // 3], axis=1)
    floor, wall = np.flatnonzero(part.flat)[-1], np.flatnonzero(part.tube)[0]
    inside = prices.price[(kind[:, 0] == kind[:, 1]) & part.flat[kind[:, 0]]]
    smooth = prices.price[(kind == wall).all(1)]
    concave = prices.price[(kind == sorted([floor, wall])).all(1)]
    convex = prices.price[(kind == sorted([1, wall])).all(1)]
    assert min(len(k) for k in (inside, smooth, concave, convex)) > 0
    rows = surface.edge_lengths[(kind == wall).all(1)] < 0.501  # without the diagonals of the quads
    assert inside.min() > smooth[rows].max() > convex.max() > concave.max()
    assert prices.flat.sum() >= len(inside)


def test_copies_of_a_part_get_the_same_charts() -> None:
    """Three pipes, one of them turned, and one a little longer: that one is no copy."""
    part = PARTS["flanged pipe"]()
    turned = part.points @ shapes.rotation(1).T + [5.0, 0, 0]
    longer = part.points * [1.0, 1.0, 1.1] + [0, 5.0, 0]
    surface = surface_of(
        *shapes.join((part.points, part.faces), (turned, part.faces), (longer, part.faces))
    )
    copies = find_copies(surface)
    m = len(part.faces)
    assert np.array_equal(copies.original, np.r_[np.arange(m), np.arange(m), 2 * m + np.arange(m)])
    atlas = Atlas(surface, SEAMS["charts"].function(surface, SeamOptions(), Monitor()).cut)
    n = len(atlas.cut) // 3
    assert np.array_equal(atlas.cut[:n], atlas.cut[n : 2 * n])
    _, chart = atlas.charts()
    assert len(np.unique(chart[:m])) == len(np.unique(chart[m : 2 * m]))


def test_mirror_images_and_other_windings_are_no_copies() -> None:
    """Same faces, same sides: but a dent is no bump, and an edge locked on one side is none on the other."""
    points, faces = shapes.grid(3, 3)
    points = points + np.array([[0, 0, 0.3]]) * (np.arange(9) == 4)[:, None]
    dent = points * [1, 1, -1] + [3.0, 0, 0]
    surface = surface_of(*shapes.join((points, faces), (dent, faces)))
    assert find_copies(surface).first.all()
    twice = surface_of(*shapes.join((points, faces), (points + 3.0, faces)))
    assert find_copies(twice).first.mean() == 0.5
    locked = twice.locked.copy()
    locked[0] = True
    assert find_copies(dataclasses.replace(twice, locked=locked)).first.all()


def test_the_helper_changes_nothing() -> None:
    """Halves of the trials by a second process, or all here."""
    part = PARTS["plate"]()
    surface = surface_of(part.points, part.faces)
    out = []
    for wanted in (True, False):
        with Worker(module.__name__, wanted) as worker:
            out.append(
                module.hard_atlas(surface, 1.05, SeamOptions(), worker, Monitor(), []).corners
            )
    assert np.array_equal(*out)
