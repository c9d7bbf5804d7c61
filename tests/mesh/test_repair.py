"""Repair in front of the solve: what is set aside, paired and turned, and that the layout comes back whole."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.errors import InputError, TopologyError
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import RepairOptions, repair
from tests.support import shapes
from tests.support.surfaces import check_complete, check_surface, doubled_edges


def test_far_from_the_origin_nothing_is_lost():
    p, f = shapes.icosphere(2)
    mesh = Mesh(np.round(p * 2**12) / 2**12 + 2.0**30, f)
    near = Mesh(np.round(p * 2**12) / 2**12, f)
    assert np.allclose(repair(mesh)[0].areas, repair(near)[0].areas, rtol=1e-9, atol=0)


@pytest.mark.parametrize("sheets", [3, 4, 5, 8, 40])
def test_crowded_edges_keep_the_straightest_pairs(sheets):
    n = 5
    mesh = Mesh(*shapes.fins(sheets, n))
    surface, repairs = repair(mesh)
    assert repairs.nonmanifold_edges == n - 1
    check_surface(mesh, surface, repairs)
    p = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    assert p.n_charts == (sheets + 1) // 2, "layers go on in pairs, an odd one ends"
    if sheets % 2 == 0:  # every sheet has one straight ahead: no edge is bent
        a, b = surface.normals[surface.edges.T // 3]
        assert np.allclose(np.abs((a * b).sum(1)), 1)


def test_a_pinched_vertex_becomes_one_for_each_fan():
    mesh = Mesh(*shapes.pinched())
    surface, repairs = repair(mesh)
    assert repairs.nonmanifold_vertices == 1
    assert surface.cut_mesh(np.zeros(len(surface.edges), bool)).n_charts == 2
    check_complete(mesh, surface, repairs)


def test_refusing_repair_names_what_is_wrong():
    with pytest.raises(TopologyError, match=r"4 non-manifold edges.*--no-repair"):
        repair(Mesh(*shapes.fins(3)), RepairOptions(allow=False))
    with pytest.raises(TopologyError, match="1 non-manifold vertex split"):
        repair(Mesh(*shapes.pinched()), RepairOptions(allow=False))
    with pytest.raises(TopologyError, match="only one side"):
        repair(Mesh(*shapes.moebius()), RepairOptions(allow=False))


soup = st.integers(3, 9).flatmap(
    lambda n: st.tuples(
        st.lists(st.tuples(*[st.integers(0, 2).map(float)] * 3), min_size=n, max_size=n),
        st.lists(st.tuples(*[st.integers(0, n - 1)] * 3), min_size=1, max_size=40),
    )
)


@settings(max_examples=150)
@given(soup, st.booleans())
def test_any_soup_becomes_a_surface_and_comes_back(case, paired):
    points, faces = case
    polygons = np.arange(len(faces)) // 2 if paired else None
    mesh = Mesh(np.array(points), np.array(faces), polygons=polygons)
    try:
        surface, repairs = repair(mesh)
    except InputError:
        assume(False)  # nothing but degenerate faces
    check_surface(mesh, surface, repairs)
    check_complete(mesh, surface, repairs)
    if not paired:
        assert doubled_edges(surface) == 0
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    genus = 2 - cut_mesh.euler() - np.bincount(cut_mesh.loops.chart, minlength=cut_mesh.n_charts)
    assert (genus % 2 == 0).all(), "every component is orientable"
    assert (genus >= 0).all()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["torus", "fins", "moebius", "klein", "wound at random"])
def test_a_surface_by_position_does_not_depend_on_the_order_of_the_file(name, seed):
    """Faces, corners and vertices shuffled: the same faces in the same order, paired, wound and torn alike."""
    shape = {"fins": shapes.fins(5), "wound at random": shapes.icosphere(2)}.get(name)
    p, f = shape if shape is not None else getattr(shapes, name)()
    if name == "wound at random":
        f = np.where(np.arange(len(f))[:, None] % 3 == 0, f[:, ::-1], f)
    options = RepairOptions(by_position=True)
    q, g, _, _ = shapes.shuffled(p, f, seed)
    one, other = repair(Mesh(p, f), options)[0], repair(Mesh(q, g), options)[0]
    assert np.array_equal(one.points[one.faces], other.points[other.faces])
    for part in ("edges", "torn", "reversed_faces", "locked"):
        assert np.array_equal(getattr(one, part), getattr(other, part)), part
    assert np.array_equal(other.from_file(g), other.faces)
    assert np.array_equal(other.to_file(other.faces), g[other.source])


def test_corners_of_a_part_of_a_surface_are_those_of_the_file():
    points, faces = shapes.noisy(*shapes.icosphere(2), amount=0.05)
    faces[::5] = faces[::5, ::-1]
    part = repair(Mesh(points, faces), RepairOptions(by_position=True))[0].part(
        np.arange(len(faces)) % 2 == 0
    )
    np.testing.assert_array_equal(part.from_file(faces), part.faces)
    np.testing.assert_array_equal(part.to_file(part.faces), faces[part.source])
