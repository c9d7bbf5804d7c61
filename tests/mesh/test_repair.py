"""Repair in front of the solve: what is set aside, paired and turned, and that the layout comes back whole."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.core.monitor import Monitor
from circparam.errors import InputError, OptionError, TopologyError
from circparam.geometry.overlap import signs
from circparam.mesh.mesh import Mesh
from circparam.mesh.orientation import double_cover
from circparam.mesh.repair import RepairOptions, repair
from circparam.mesh.restore import complete
from circparam.seams import SEAMS
from circparam.seams.options import SeamOptions
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes


def check_surface(mesh, surface, repairs):
    """What every surface promises, whatever the mesh."""
    e = surface.edges
    start = surface.faces.ravel()
    end = surface.faces[:, [1, 2, 0]].ravel()
    assert (start[e[:, 0]] == end[e[:, 1]]).all(), "paired half-edges run against each other"
    assert (end[e[:, 0]] == start[e[:, 1]]).all()
    assert len(np.unique(e)) == e.size, "a half-edge belongs to one pair"
    assert (e[:, 0] < e[:, 1]).all()
    assert (np.diff(e[:, 0]) > 0).all()
    assert (surface.areas > 0).all()
    assert np.isfinite(surface.rest_triangles).all()
    points = np.sort(surface.faces, 1)
    same = (points[e[:, 0] // 3] == points[e[:, 1] // 3]).all(1)
    assert not same.any(), "two faces with the same points, joined, could not lie in the plane"
    parts = [repairs.kept, repairs.degenerate, repairs.duplicates]
    assert sorted(np.concatenate(parts).tolist()) == list(range(len(mesh.faces)))
    assert np.array_equal(surface.source, repairs.kept)
    file_faces = repairs.weld[mesh.faces[surface.source]]
    back = np.where(surface.reversed_faces[:, None], surface.faces[:, [0, 2, 1]], surface.faces)
    assert np.array_equal(back, file_faces), "corners are those of the file, turned or not"


def doubled_edges(surface):
    """Number of inner edges that have both ends in common with another one."""
    vertex = surface.corner_vertex.ravel()
    h = surface.edges[:, 0]
    ends = np.sort(np.stack([vertex[h], vertex[h - h % 3 + (h + 1) % 3]], 1), 1)
    return len(ends) - len(np.unique(ends, axis=0))


def layout(surface, cut=None):
    """Any uv over the surface, one uv vertex for each vertex of the cut mesh."""
    cut = np.zeros(len(surface.edges), bool) if cut is None else cut
    cut_mesh = surface.cut_mesh(cut)
    rng = np.random.default_rng(0)
    return rng.random((cut_mesh.n_vertices, 2)), cut_mesh.faces


def check_complete(mesh, surface, repairs):
    """Every face of the file gets uv; each corner gets uv of its own point, for twins that of the kept face."""
    uv, uv_faces = layout(surface)
    before = mesh.faces.copy(), uv.copy(), uv_faces.copy()
    got = complete(mesh, surface, repairs, uv, uv_faces)
    assert all(
        np.array_equal(x, y) for x, y in zip((mesh.faces, uv, uv_faces), before, strict=True)
    )
    assert got.uv_faces.shape == mesh.faces.shape
    assert got.uv_faces.min() >= 0
    assert got.uv_faces.max() < len(uv)
    point = np.full(len(uv), -1)
    point[uv_faces.ravel()] = surface.faces.ravel()
    welded = repairs.weld[mesh.faces]
    live = np.ones(len(welded), bool)
    live[repairs.degenerate] = False
    assert np.array_equal(point[got.uv_faces][live], welded[live])
    return got


def test_a_clean_mesh_is_taken_as_it_is():
    mesh = Mesh(*shapes.torus())
    surface, repairs = repair(mesh, RepairOptions(allow=False))
    assert repairs.clean
    assert repairs.messages == []
    assert np.array_equal(surface.faces, mesh.faces)
    assert len(surface.edges) * 2 == mesh.faces.size
    assert len(surface.boundary) == 0
    check_surface(mesh, surface, repairs)
    got = check_complete(mesh, surface, repairs)
    assert np.array_equal(got.uv_faces, layout(surface)[1])


def test_coincident_vertices_are_one_by_a_map():
    p, f = shapes.icosphere(2)
    soup = Mesh(p[f].reshape(-1, 3), np.arange(f.size).reshape(-1, 3))
    surface, repairs = repair(soup)
    assert repairs.clean
    assert len(surface.boundary) == 0
    assert surface.cut_mesh(np.zeros(len(surface.edges), bool)).euler().tolist() == [2]
    assert surface.points is soup.points


def test_tolerance_closes_a_crack_and_refuses_to_swallow_the_mesh():
    p, f = shapes.icosphere(2)
    p = p[f].reshape(-1, 3) + 1e-6 * np.random.default_rng(0).random((f.size, 3))
    mesh = Mesh(p, np.arange(f.size).reshape(-1, 3))
    surface, _ = repair(mesh)
    assert len(surface.edges) == 0
    surface, repairs = repair(mesh, RepairOptions(weld_eps=1e-5))
    assert len(surface.boundary) == 0
    assert repairs.near_vertices > 0
    assert "tolerance" in repairs.messages[0]
    check_complete(mesh, surface, repairs)
    with pytest.raises(OptionError, match="whole neighbourhoods"):
        repair(Mesh(*shapes.icosphere(4)), RepairOptions(weld_eps=5.0))
    with pytest.raises(OptionError, match="at least 0"):
        repair(mesh, RepairOptions(weld_eps=-1.0))


def test_degenerate_and_duplicate_faces_are_set_aside_and_get_uv():
    p, f = shapes.grid(4, 4)
    p = np.concatenate([p, [[0.5, 0.0, 0.0]], [[9.0, 9, 9]]])
    extra = [[0, 0, 1], [0, 4, 8], f[2][[1, 2, 0]], f[3][[2, 1, 0]], [17, 17, 17]]
    mesh = Mesh(p, np.concatenate([f, np.array(extra)]))
    surface, repairs = repair(mesh)
    n = len(f)
    assert repairs.degenerate.tolist() == [n, n + 1, n + 4]
    assert repairs.duplicates.tolist() == [n + 2, n + 3]
    assert repairs.duplicate_of.tolist() == [2, 3]
    assert repairs.unreferenced == 1
    check_surface(mesh, surface, repairs)
    got = check_complete(mesh, surface, repairs)
    # a repeated or collinear face covers no uv area, and its uv are those of its own points or of one chart
    assert (signs(got.uv, got.uv_faces[repairs.degenerate]) == 0).all()
    assert got.uv_faces[n].tolist() == [got.uv_faces[0][0]] * 2 + [got.uv_faces[n][2]]
    assert set(got.uv_faces[n + 2]) == set(got.uv_faces[2])


def test_a_degenerate_face_that_fills_a_gap_of_its_chart_keeps_the_uv_of_its_points():
    """A T-junction: vertex 3 lies on edge 0–1 of the lower triangle; face (0, 3, 1) closes the slit."""
    p = np.array([[0.0, 0, 0], [2, 0, 0], [1, -1, 0], [1, 0, 0], [1, 1, 0]])
    mesh = Mesh(p, np.array([[0, 2, 1], [0, 3, 4], [3, 1, 4], [0, 1, 3]]))
    surface, repairs = repair(mesh)
    assert repairs.degenerate.tolist() == [3]
    # a layout in one chart, the slit open: uv vertices as in space
    uv = np.array([[0.0, 0], [2, 0], [1, -1], [1, 0.2], [1, 1]])
    got = complete(mesh, surface, repairs, uv, surface.faces)
    assert got.uv_faces[3].tolist() == [0, 1, 3]


def test_a_degenerate_face_takes_the_chart_of_its_own_polygon():
    p, f = shapes.grid(3, 2)
    f = np.concatenate([f, [[2, 3, 3]]])
    for polygon in range(4):
        mesh = Mesh(p, f, polygons=np.array([0, 1, 2, 3, polygon]))
        surface, repairs = repair(mesh)
        assert repairs.degenerate.tolist() == [4]
        cut = np.ones(len(surface.edges), bool)  # so no two faces have a uv vertex in common
        uv, uv_faces = layout(surface, cut)
        got = complete(mesh, surface, repairs, uv, uv_faces).uv_faces[4]
        own = dict(zip(surface.faces[polygon].tolist(), uv_faces[polygon].tolist(), strict=True))
        assert set(got.tolist()) <= set(own.values())
        for corner, vertex in enumerate(f[4].tolist()):
            assert vertex not in own or got[corner] == own[vertex]


def test_a_doubled_triangle_lies_with_its_polygon():
    """Two quads on three common points: a corner has one uv, so the double may not lie in the other quad."""
    p = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.2], [0.9, 0.1, 1]])
    f = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [2, 0, 4]])
    surface, repairs = repair(Mesh(p, f, polygons=np.array([0, 0, 1, 1])))
    assert len(surface.faces) == 4, "each quad keeps both of its triangles"
    cut = np.ones(len(surface.edges), bool) & ~surface.locked
    uv, uv_faces = layout(surface, cut)
    got = complete(Mesh(p, f), surface, repairs, uv, uv_faces)
    quads = [set(got.uv_faces[k].ravel().tolist()) for k in ([0, 1], [2, 3])]
    assert [len(q) for q in quads] == [4, 4]
    assert not quads[0] & quads[1]
    for polygons in (None, np.array([0, 0, 1, 2]), np.array([0, 1, 0, 2])):
        _, repairs = repair(Mesh(p, f, polygons=polygons))
        assert repairs.duplicates.tolist() == [2], "no face of its own ties it to another place"


def test_all_faces_degenerate_is_an_input_error():
    with pytest.raises(InputError, match="degenerate"):
        repair(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])))
    line = np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3]])
    with pytest.raises(InputError, match="degenerate"):
        repair(Mesh(line, np.array([[0, 1, 2], [0, 0, 1]])))


@pytest.mark.parametrize("scale", [1e-300, 1e-30, 1e-12, 1.0, 1e12, 1e30, 1e150, 1e300])
def test_what_counts_as_degenerate_does_not_depend_on_the_scale(scale):
    p, f = shapes.bumped_disk(200)
    needle = np.array(
        [[0, 0, 3], [1, 0, 3], [0.5, 1e-13, 3], [0, 0, 4], [1, 0, 4], [0.5, 1e-11, 4]]
    )
    n = len(p)
    f = np.concatenate([f, [[n, n + 1, n + 2], [n + 3, n + 4, n + 5]]])
    mesh = Mesh(np.concatenate([p, needle]) * scale, f)
    surface, repairs = repair(mesh)
    assert repairs.degenerate.tolist() == [len(f) - 2]
    assert np.array_equal(surface.points, mesh.points * repairs.scale)
    assert np.log2(repairs.scale) % 1 == 0
    if 1e-12 <= scale <= 1e12:
        assert repairs.scale == 1
    check_surface(mesh, surface, repairs)


def test_far_from_the_origin_nothing_is_lost():
    p, f = shapes.icosphere(2)
    mesh = Mesh(np.round(p * 2**12) / 2**12 + 2.0**30, f)
    near = Mesh(np.round(p * 2**12) / 2**12, f)
    assert np.allclose(repair(mesh)[0].areas, repair(near)[0].areas, rtol=1e-9, atol=0)


def test_winding_is_made_consistent_and_undone_in_the_file():
    p, f = shapes.icosphere(3)
    rng = np.random.default_rng(1)
    back = rng.random(len(f)) < 0.3
    mixed = np.where(back[:, None], f[:, [0, 2, 1]], f)
    mesh = Mesh(p, mixed)
    surface, repairs = repair(mesh)
    assert np.array_equal(surface.reversed_faces, back), "the side with more area wins"
    assert repairs.n_reversed == back.sum()
    check_surface(mesh, surface, repairs)
    uv, uv_faces = layout(surface)
    got = complete(mesh, surface, repairs, uv, uv_faces)
    solved = signs(uv, uv_faces)
    assert np.array_equal(signs(got.uv, got.uv_faces), np.where(back, -solved, solved))


def test_components_are_oriented_each_by_its_own_majority():
    p, f = shapes.join(shapes.icosphere(1), shapes.icosphere(1))
    f = f.copy()
    f[:80] = f[:80, ::-1]  # all of the first one: nothing disagrees, nothing is turned
    f[81] = f[81][::-1]
    surface, repairs = repair(
        Mesh(p + [[0, 0, 0]] * 42 + [[5, 0, 0]] * 42 if False else _apart(p), f)
    )
    assert np.flatnonzero(surface.reversed_faces).tolist() == [81]
    assert repairs.n_reversed == 1


def _apart(p):
    p = p.copy()
    p[len(p) // 2 :] += [5, 0, 0]
    return p


@pytest.mark.parametrize("polygons", [False, True])
@pytest.mark.parametrize("shape", [shapes.moebius, shapes.klein])
def test_one_sided_surfaces_are_cut_open_between_polygons(shape, polygons):
    p, f = shape()
    quads = np.arange(len(f)) // 2 if polygons else None
    back = np.random.default_rng(4).random(len(f)) < 0.4  # windings differ even inside a polygon
    f = np.where(back[:, None], f[:, [0, 2, 1]], f)
    mesh = Mesh(p, f, polygons=quads)
    surface, repairs = repair(mesh)
    assert repairs.non_orientable == 1
    assert repairs.mobius_edges > 0
    assert repairs.nonmanifold_vertices == 0
    check_surface(mesh, surface, repairs)
    assert surface.cut_mesh(np.zeros(len(surface.edges), bool)).n_charts == 1
    if polygons:
        inside = quads[surface.source[surface.edges // 3]]
        assert int((inside[:, 0] == inside[:, 1]).sum()) == len(f) // 2, "no polygon is cut"
        assert np.array_equal(surface.locked, inside[:, 0] == inside[:, 1])


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


@pytest.mark.parametrize("seed", range(6))
def test_a_wall_through_a_sheet_hangs_on_no_single_edge(seed):
    """Faces wound at random: a wall joined to the sheet along one edge would have no room in any map."""
    p, f = shapes.grid(7, 7)
    q, g = shapes.grid(7, 4)
    wall = np.stack([q[:, 0], np.full(len(q), p[3, 1]), q[:, 1] - 1 / 3], 1)
    p, f = shapes._weld(*shapes.join((p, f), (wall, g)))
    turn = np.random.default_rng(seed).random(len(f)) < 0.2
    mesh = Mesh(p, np.where(turn[:, None], f[:, ::-1], f))
    surface, repairs = repair(mesh)
    assert repairs.nonmanifold_edges == 6
    check_surface(mesh, surface, repairs)
    assert doubled_edges(surface) == 0
    uv, _ = tutte_embedding(*disks_of(surface))
    assert (signs(uv, disks_of(surface)[0].faces) > 0).all()


def disks_of(surface):
    """The cut mesh of a surface cut to disks, as the arguments of ``tutte_embedding``."""
    seams = SEAMS["disk"].function(surface, SeamOptions(), Monitor())
    return surface.cut_mesh(seams.cut), "circle"


def test_two_cubes_that_share_an_edge_stay_wound_alike():
    p, f = shapes.cube(1)
    q = np.unique(np.round(p, 9), axis=0)
    step = q.max(0) - q.min(0)
    mesh = Mesh(np.concatenate([p, p + step * [1, 1, 0]]), np.concatenate([f, f + len(p)]))
    surface, repairs = repair(mesh)
    assert repairs.nonmanifold_edges == 1
    assert repairs.n_reversed == 0
    check_surface(mesh, surface, repairs)


def test_a_pinched_vertex_becomes_one_for_each_fan():
    mesh = Mesh(*shapes.pinched())
    surface, repairs = repair(mesh)
    assert repairs.nonmanifold_vertices == 1
    assert surface.cut_mesh(np.zeros(len(surface.edges), bool)).n_charts == 2
    check_complete(mesh, surface, repairs)


def test_refusing_repair_names_what_is_wrong():
    with pytest.raises(TopologyError, match=r"4 non-manifold edges.*--no-repair"):
        repair(Mesh(*shapes.fins(3)), RepairOptions(allow=False))
    with pytest.raises(TopologyError, match="1 non-manifold vertices"):
        repair(Mesh(*shapes.pinched()), RepairOptions(allow=False))
    with pytest.raises(TopologyError, match="one side only"):
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


@given(
    st.integers(2, 12), st.lists(st.tuples(st.integers(0, 11), st.integers(0, 11), st.booleans()))
)
def test_double_cover_finds_signs_where_there_are_any(n, edges):
    edges = [(i % n, j % n, flip) for i, j, flip in edges]
    i, j, flip = (np.array([e[k] for e in edges], [int, int, bool][k]) for k in range(3))
    component, sign, two_sided = double_cover(n, i, j, flip)
    wrong = (sign[i] ^ sign[j]) != flip if len(edges) else np.zeros(0, bool)
    assert not wrong[two_sided[component[i]]].any() if len(edges) else True
    for c in np.flatnonzero(~two_sided):  # by hand: no signs satisfy all pairs of this component
        nodes = np.flatnonzero(component == c)
        mine = [(a, b, x) for a, b, x in edges if a in nodes]
        for bits in range(2 ** len(nodes)):
            value = {int(v): bits >> k & 1 for k, v in enumerate(nodes)}
            assert any((value[a] ^ value[b]) != x for a, b, x in mine)


@pytest.mark.parametrize("n", [40])
def test_a_mesh_with_many_crowded_edges(n):
    """Three layers through every line of a grid, as in a soup of walls."""
    p, f = shapes.grid(n, n)
    up = p.copy()
    up[:, 2] += 0.01
    walls = np.array([[k, k + 1, len(p) + k] for k in range(0, len(p) - 1) if (k + 1) % n])
    mesh = Mesh(np.concatenate([p, up]), np.concatenate([f, walls]))
    surface, repairs = repair(mesh)
    assert repairs.nonmanifold_edges > 0.3 * len(f) / 2
    check_surface(mesh, surface, repairs)
    flat = surface.source < len(f)
    inner = flat[surface.edges // 3].all(1)
    assert inner.sum() == (3 * len(f) - 4 * (n - 1)) // 2, "the flat sheet goes on straight"


def test_no_face_or_vertex_is_touched():
    p, f = shapes.fins(3)
    points, faces = p.copy(), f.copy()
    repair(Mesh(points, faces), RepairOptions(weld_eps=1e-9))
    assert np.array_equal(points, p)
    assert np.array_equal(faces, f)
