"""Opening surfaces: every component one disk but for holes, along short seams, never inside a polygon."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.core.monitor import Monitor
from circparam.errors import InputError, OptionError, TopologyError
from circparam.mesh.cut_mesh import close_holes
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.seams import SEAMS
from circparam.seams.constraints import dihedral_angles
from circparam.seams.options import SeamOptions
from tests.support import shapes
from tests.support.atlases import ends, surface_of


def cut_disk(surface, options=None):
    options = SeamOptions() if options is None else options
    return SEAMS["disk"].function(surface, options, Monitor())


def check_disks(surface, cut, components=None):
    """Every chart is a disk once its holes are closed, and its outer boundary is a polygon."""
    cut_mesh = surface.cut_mesh(cut)
    closed = close_holes(cut_mesh)
    assert (closed.euler() == 1).all()
    assert (np.bincount(closed.loops.chart, minlength=closed.n_charts) == 1).all()
    loops = cut_mesh.loops
    assert (np.diff(loops.start)[loops.outer] >= 3).all()
    if components is not None:
        assert cut_mesh.n_charts == components
    return cut_mesh


CLOSED = {
    "sphere": (shapes.icosphere(3), 1),
    "cube": (shapes.cube(), 1),
    "capped cylinder": (shapes.cylinder(caps=True), 1),
    "torus": (shapes.torus(), 1),
    "double torus": (shapes.double_torus(), 1),
    "five handles": (shapes.handles(5), 1),
    "tetrahedron": ((np.eye(4, 3), np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])), 1),
    "three at once": (shapes.join(shapes.icosphere(1), shapes.torus(), shapes.grid()), 3),
    "row of tori": (shapes.row_of(shapes.torus(), 4), 4),
    "moebius": (shapes.moebius(), 1),
    "klein": (shapes.klein(), 1),
    "fins": (shapes.fins(5), 3),
    "holes": (shapes.holed_sheet(25), 1),
}


@pytest.mark.parametrize("name", CLOSED)
def test_every_component_becomes_one_disk(name):
    shape, components = CLOSED[name]
    surface = surface_of(*shape)
    seams = cut_disk(surface)
    check_disks(surface, seams.cut, components)


def test_disks_and_inner_holes_are_not_cut():
    for shape in (shapes.grid(), shapes.annulus(), shapes.holed_sheet(25), shapes.hemisphere()):
        assert not cut_disk(surface_of(*shape)).cut.any()


def test_the_seams_of_a_torus_are_about_its_two_shortest_loops():
    surface = surface_of(*shapes.torus(64, 32, 1.0, 0.35))
    length = surface.edge_lengths[cut_disk(surface).cut].sum()
    shortest = 2 * np.pi * 0.35 + 2 * np.pi * 0.65
    assert 0.9 * shortest < length < 1.15 * shortest


def test_time_that_is_up_still_gives_a_valid_cut():
    surface = surface_of(*shapes.handles(3))
    seams = SEAMS["disk"].function(surface, SeamOptions(), Monitor(timeout=0.0))
    check_disks(surface, seams.cut, 1)


def test_a_sphere_opens_between_far_ends():
    """An ellipsoid opens along its length, and no further than from tip to tip."""
    p, f = shapes.icosphere(4)
    surface = surface_of(p * [4, 1, 1], f)
    seams = cut_disk(surface)
    touched = surface.faces.ravel()[surface.edges[seams.cut, 0]]
    assert np.ptp(surface.points[touched, 0]) > 7
    assert surface.edge_lengths[seams.cut].sum() < 1.2 * 8.6  # half the perimeter of the ellipse


def test_forbidden_edges_are_never_cut():
    surface = surface_of(*shapes.torus())
    free = cut_disk(surface)
    pairs = ends(surface)
    seams = cut_disk(surface, SeamOptions(no_cut=pairs[free.cut]))
    check_disks(surface, seams.cut, 1)
    assert not (seams.cut & free.cut).any()
    with pytest.raises(OptionError, match=r"with a handle .*: allow seams along some of their"):
        cut_disk(surface, SeamOptions(no_cut=pairs[3:]))


def test_demanded_seams_are_kept_and_each_part_becomes_a_disk():
    surface = surface_of(*shapes.cube(4))
    seams = cut_disk(surface, SeamOptions(sharp=np.radians(60)))
    check_disks(surface, seams.cut, 6)
    sharp = dihedral_angles(surface) > 1
    assert np.array_equal(seams.cut, sharp)
    groups = (surface.points[surface.faces].mean(1)[:, 2] > 0).astype(np.int64)
    seams = cut_disk(surface, SeamOptions(groups=groups, cut_groups=True))
    across = groups[surface.edges[:, 0] // 3] != groups[surface.edges[:, 1] // 3]
    assert np.array_equal(seams.cut, across), "two halves with one boundary each need no more"


def test_none_takes_disks_and_names_what_is_no_disk():
    none = SEAMS["none"].function
    assert not none(surface_of(*shapes.grid()), SeamOptions(), Monitor()).cut.any()
    cases = {
        "0 boundaries and genus 1": shapes.torus(),
        "2 boundaries and genus 0": shapes.annulus(),
        "0 boundaries and genus 0": shapes.icosphere(),
    }
    for message, shape in cases.items():
        with pytest.raises(TopologyError, match=f"component 0 .*{message}.*--cut disk"):
            none(surface_of(*shape), SeamOptions(), Monitor())
    with pytest.raises(TopologyError, match=r"component 1 .*first is face 96"):
        none(surface_of(*shapes.join(shapes.grid(), shapes.torus())), SeamOptions(), Monitor())


def test_a_slit_of_a_face_without_area_is_no_boundary():
    p = np.array([[0.0, 0, 0], [2, 0, 0], [1, -1, 0], [1, 0, 0], [1, 1, 0]])
    p = np.concatenate([p, [[3, -1, 0], [3, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, 3, 0], [1, -3, 0]]])
    f = [[0, 2, 1], [0, 3, 4], [3, 1, 4], [0, 1, 3]]
    f += [[1, 2, 5], [1, 5, 6], [1, 6, 4], [0, 4, 7], [0, 7, 8], [0, 8, 2]]
    surface = surface_of(p, np.array(f))
    assert len(surface.cut_mesh(np.zeros(len(surface.edges), bool)).loops.chart) == 2
    assert not SEAMS["none"].function(surface, SeamOptions(), Monitor()).cut.any()
    q, g = shapes.icosphere(2)
    middle = (q[g[0, 0]] + q[g[0, 1]]) / 2
    a, b, c = g[0]
    n = len(q)
    g = np.concatenate([g[1:], [[a, n, c], [n, b, c], [a, b, n]]])
    surface = surface_of(np.concatenate([q, [middle]]), g)
    assert len(surface.source) == len(g) - 1
    cut_mesh = check_disks(surface, cut_disk(surface).cut, 1)
    assert cut_mesh.loops.length.max() > 2, (
        "a closed surface with a slit is opened like a closed one"
    )


soup = st.integers(4, 9).flatmap(
    lambda n: st.tuples(
        st.just(n), st.lists(st.tuples(*[st.integers(0, n - 1)] * 3), min_size=1, max_size=30)
    )
)


@settings(max_examples=120)
@given(soup, st.booleans())
def test_any_soup_opens_into_disks(case, paired):
    n, faces = case
    points = np.random.default_rng(1).normal(size=(n, 3))
    polygons = np.arange(len(faces)) // 2 if paired else None
    try:
        surface, _ = repair(Mesh(points, np.array(faces), polygons=polygons))
    except InputError:
        assume(False)  # nothing but degenerate faces
    seams = cut_disk(surface)
    cut_mesh = surface.cut_mesh(seams.cut)
    closed = close_holes(cut_mesh)
    assert (closed.euler() == 1).all()
    assert not (seams.cut & surface.locked).any()
    assert cut_mesh.n_charts == surface.charts(np.zeros(len(surface.edges), bool))[0]
