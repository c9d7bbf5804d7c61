"""Hard surfaces: seams stay out of flats, tubes unroll whole, and nothing changes for organic shapes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.seams.charts import bounded_atlas, free_atlas, with_creases
from circparam.seams.hard.charts import unrolls_whole
from circparam.seams.hard.regions import flats, hard_components
from circparam.seams.hard.unroll import unroll
from circparam.seams.options import SeamOptions, Search
from circparam.seams.prices import edge_prices
from circparam.seams.segmentation.grow import DualGraph, make_disks
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import assert_promises, charts_of, surface_of, uncut
from tests.support.machined import housing, shaft
from tests.support.parts import PARTS, Part, circle, extrude, lathe, rectangle, rounded_box, shaken


def check_whole(part: Part, bound: float = 1.05) -> Atlas:
    """All that is promised of charts; no seam runs inside a flat, and each flat and tube is in one chart."""
    surface = surface_of(part.points, part.faces)
    assert hard_components(surface).all()
    atlas = charts_of(surface, max_distortion=bound)
    assert_promises(atlas, bound)
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


@pytest.mark.parametrize("make", [housing, shaft])
def test_however_a_part_lies_in_space(make) -> None:
    """Which of forty alike lines opens a tube is up to rounding, so one chart more or less may merge."""
    part, counts = make(), []
    for turn in (np.eye(3), shapes.rotation(1)):
        points = part.points @ turn.T
        whole = check_whole(Part(points, part.faces, part.surface, part.flat, part.tube))
        counts.append(whole.charts()[0])
    assert max(counts) - min(counts) <= 1


@pytest.mark.parametrize("bound", [1.05, 1.01])
def test_flats_of_a_part_without_any_sharp_edge_stay_whole(bound) -> None:
    check_whole(rounded_box(), bound)


def in_flats(shape: shapes.Shape) -> float:
    """Length of the seams inside flats, in roots of the area."""
    surface = surface_of(*shape)
    atlas = charts_of(surface)
    assert_promises(atlas, 1.05)
    return float(surface.edge_lengths[atlas.cut & flats(surface)[1]].sum() / surface.unit)


@pytest.mark.parametrize("steps", [1, 2])
def test_no_seam_crosses_the_quads_of_a_bevelled_block(steps: int) -> None:
    """Each side is one quad, cut in two anywhere; a fillet may be crossed."""
    block = rounded_box(steps, 0.05)
    assert in_flats((block.points, block.faces)) < 0.02


@pytest.mark.parametrize("around", [12, 16])
def test_seams_lead_round_the_quads_of_a_bent_tube(around: int) -> None:
    """In all a tenth of a loop round the tube, 0.59, may lie inside them."""
    assert in_flats(shapes.torus(2 * around, around)) < 0.06


def walk(*stops: tuple[int, int]) -> list[tuple[int, ...]]:
    """Squares along straight lines from one stop to the next."""
    cells = [stops[:1]]
    for a, b in itertools.pairwise(np.array(stops)):
        steps = np.arange(1, np.abs(b - a).max() + 1)
        cells.append([tuple(x) for x in (a + np.outer(steps, np.sign(b - a))).tolist()])
    return list(itertools.chain(*cells))


def plumbed() -> shapes.Shape:
    """Two belts of squares in one plane, joined at a square and lying over each other elsewhere: a handle."""
    box = [(x, y) for y in (0, 1) for x in (0, 1)]
    east = walk((1, 0), (2, 0), (2, 3), (-2, 3), (-2, 0), (-1, 0))
    north = walk((0, 1), (0, 4), (3, 4), (3, -2), (0, -2), (0, -1))
    number: dict[tuple[int, ...], int] = {}
    faces = []
    for belt, cells in enumerate([[(0, 0)], east, north]):
        for x, y in cells:
            corners = [(x + a, y + b) for a, b in box]
            ids = [number.setdefault(c if c in box else (belt, *c), len(number)) for c in corners]
            faces += [[ids[0], ids[1], ids[3]], [ids[0], ids[3], ids[2]]]
    # a shift keeps corners that lie over each other apart
    points = np.array([np.add(key[-2:], 0.1 * (len(key) == 3 and key[0] == 2)) for key in number])
    return np.c_[points, np.zeros(len(points))], np.array(faces)


def test_a_flat_with_a_handle_is_cut() -> None:
    """No plane holds it as a whole, so it is no flat of the design."""
    atlas = uncut(*plumbed())
    surface = atlas.surface
    assert not_disks(atlas.cut_mesh()).all()
    make_disks(atlas, DualGraph(surface, edge_prices(surface).flat))
    assert not not_disks(atlas.cut_mesh()).any()
    assert_promises(charts_of(surface), 1.05)


@pytest.mark.parametrize(("name", "scale"), [("flanged pipe", 1e-3), ("letters", 25.4)])
def test_noise_of_single_precision_and_units_cut_no_flat(name, scale) -> None:
    part = shaken(PARTS[name](), 1e-7)
    check_whole(Part(part.points * scale, part.faces, part.surface, part.flat, part.tube))


@settings(max_examples=3, deadline=None)
@example(2, 10, 0.25, 2.0, False)
@example(1, 13, 0.09375, 0.75, True)
@example(1, 13, 0.09375, 0.88, True)
@example(1, 16, 0.31420043788742086, 0.703125, True)
@given(
    st.integers(0, 3), st.integers(5, 40), st.floats(0.05, 0.4), st.floats(0.1, 3.0), st.booleans()
)
def test_plates_with_any_holes_stay_whole(holes, around, radius, height, sunk) -> None:
    """Also where pockets take the place of one hole."""
    loops = [circle(around, radius, x) for x in (-1.2, 0.0, 1.2)[:holes]]
    pockets = [(loops.pop(), height / 3)] if sunk and loops else []
    check_whole(extrude(rectangle(4.0, 1.5), loops, height, pockets))


def test_organic_components_are_laid_out_as_without_the_hard_ones() -> None:
    """A sphere beside a bracket gets the seams it has alone, where the bracket hides none of it."""
    ball = shapes.noisy(*shapes.icosphere(2), amount=0.02)
    part = PARTS["bracket"]()
    both = surface_of(*shapes.join(ball, (part.points + np.array([5.0, 0, 0]), part.faces)))
    together, single = (charts_of(s, hide_seams=0.0) for s in (both, surface_of(*ball)))
    sphere = ~hard_components(both)[both.edges[:, 0] // 3]
    assert np.array_equal(together.cut[sphere], single.cut)


def test_a_pocket_that_is_stretched_too_much_is_cut_off_along_its_rim() -> None:
    """Not slit across the flat it lies in: the plate and the rest keep few charts and short seams."""
    pocket = (circle(13, 0.09375, -1.2), 0.25)
    part = extrude(rectangle(4.0, 1.5), [], 0.75, [pocket])
    surface = surface_of(part.points, part.faces)
    loose, held = (charts_of(surface, max_stretch=stretch) for stretch in (1e6, 2.0))
    assert held.seam_length < 1.5 * loose.seam_length
    assert held.charts()[0] <= loose.charts()[0] + 3
    assert not held.cut[edge_prices(surface).flat].any()


def test_only_hard_components_have_creases() -> None:
    """Charts of a large surface are merged apart there."""
    ball = shapes.noisy(*shapes.icosphere(1), amount=0.02)
    part = PARTS["cube"]()
    surface = surface_of(*shapes.join(ball, (part.points + np.array([5.0, 0, 0]), part.faces)))
    hard = hard_components(surface)
    assert 0 < hard.sum() < len(hard)
    for make, most in ((free_atlas, None), (bounded_atlas, 2)):
        atlas = make(surface, 1.05, SeamOptions(max_charts=most), Monitor())
        assert np.array_equal(with_creases(atlas), hard)


def test_a_flanged_pipe_keeps_the_number_of_its_charts_whatever_its_tubes_have() -> None:
    """Finer tubes are the same model: as many charts, and seams as long."""
    found = []
    for n in (32, 96):
        profile = np.array([[0.5, 0], [1, 0], [1, 0.2], [0.6, 0.2], [0.6, 2], [0.5, 2]])
        atlas = check_whole(lathe(profile, n))
        found.append((atlas.charts()[0], atlas.seam_length))
    assert abs(found[0][0] - found[1][0]) <= 2
    assert found[0][1] == pytest.approx(found[1][1], rel=0.25)


@pytest.mark.parametrize("search", [Search(draft=True), Search()])
def test_a_level_sheet_that_lies_over_itself_is_cut_where_it_does(search) -> None:
    """As folded faces of decimated parts do: a ring that goes on for a quarter turn too much."""
    points, faces = shapes.wound(2.5 * np.pi, 11, 2, 0.5)
    turn = np.repeat(np.arange(11), 2)[:, None] * np.pi / 4
    level = points * [1, 1, 0] * (1 + 0.01 * turn)  # no point lies on another
    atlas = charts_of(surface_of(level, faces), search=search)
    assert_promises(atlas, 1.05)
    assert 2 <= atlas.charts()[0] <= 3


@pytest.mark.parametrize(
    ("shape", "whole"),
    [
        (shapes.planar_holes(3), True),
        (shapes.annulus(), True),
        (shapes.half_cylinder(), True),
        (shapes.row_of(shapes.half_cylinder(), 2), True),
        (shapes.cone(slit=True), True),
        (shapes.cylinder(), False),  # it must be slit
        (shapes.cone(), False),  # so must its tip
        (shapes.hemisphere(), False),
        (shapes.cube(), False),
        (shapes.half_cylinder(around=4), False),  # sharp edges, which a seam may follow
        (shapes.join(shapes.grid(), shapes.cylinder()), False),
    ],
)
def test_what_unrolls_whole_needs_no_seam(shape: shapes.Shape, whole: bool) -> None:
    """And where nothing does, nobody looks from where a seam would be seen."""
    surface = surface_of(*shape)
    assert unrolls_whole(surface) == whole
    if whole:
        cut_mesh = uncut(*shape).cut_mesh()
        assert chart_energies(cut_mesh, unroll(cut_mesh)) == pytest.approx(1, abs=1e-6)
