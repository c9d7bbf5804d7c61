"""Edges that must be seams, or may not be: named, sharp, between groups, or those of the file."""

import dataclasses

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.surface import Surface
from circparam.seams.constraints import constrain, dihedral_angles, match_edges
from circparam.seams.options import SeamOptions
from tests.support import shapes
from tests.support.atlases import ends, surface_of


def test_named_edges() -> None:
    surface = surface_of(*shapes.grid(4, 4))
    edges, missing = match_edges(surface, np.array([[5, 6], [6, 5], [0, 1], [0, 15], [3, 99]]))
    assert edges.sum() == 1
    assert missing.tolist() == [3, 4], "a boundary edge is an edge, though there is nothing to cut"
    pair = np.sort(ends(surface), 1)[edges]
    assert pair.tolist() == [[5, 6]]
    named = SeamOptions(cut=np.array([[5, 6], [0, 15]]))
    _, forced, notes = constrain(surface, named)
    assert np.array_equal(forced, edges)
    assert notes == ["1 pairs of --seams are not edges of the mesh; the first is [0, 15]"]
    with pytest.raises(OptionError, match=r"--seams names no edge.*\[0, 15\]"):
        constrain(surface, SeamOptions(cut=np.array([[0, 15]])))
    with pytest.raises(OptionError, match="1 edges are named by --seams and by --no-seams"):
        constrain(surface, SeamOptions(cut=np.array([[5, 6]]), no_cut=np.array([[6, 5]])))


@pytest.mark.parametrize("option", ["no_cut", "weights"])
def test_edges_that_leave_no_way_to_open_a_surface(option: str) -> None:
    """The error advised another cut, which did not help either."""
    surface = surface_of(*shapes.icosphere(1))
    one = np.arange(len(surface.edges)) == 7
    for allowed, works in ((np.zeros_like(one), False), (one, True)):
        weights = np.where(allowed, 1.0, np.inf)
        given = {"no_cut": np.sort(ends(surface), 1)[~allowed], "weights": weights}[option]
        asked = SeamOptions(**{option: given})
        if works:
            assert (~constrain(surface, asked)[0].locked == one).all()
            continue
        with pytest.raises(OptionError, match=r"80 faces without a boundary .* is face 0"):
            constrain(surface, asked)


def roof(degrees: float) -> Surface:
    """Two triangles that meet in one edge, their normals at an angle."""
    a = np.radians(degrees)
    points = [[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [-np.cos(a), 0, -np.sin(a)]]
    return surface_of(np.array(points), np.array([[0, 2, 1], [0, 1, 3]]))


def test_angles_of_a_cube_belong_to_its_edges() -> None:
    surface = surface_of(*shapes.cube(2))
    angle = dihedral_angles(surface)
    on = surface.points[ends(surface)]
    side = ((on == 0) | (on == 1)).all(1).sum(1) >= 2
    assert angle[side] == pytest.approx(np.pi / 2)
    assert angle[~side] == pytest.approx(0)
    assert side.sum() == 24


def test_edges_exactly_as_sharp_as_asked_are_seams() -> None:
    surface = roof(40.0)
    angle = float(dihedral_angles(surface)[0])
    assert constrain(surface, SeamOptions(sharp=angle))[1].all()
    assert not constrain(surface, SeamOptions(sharp=np.nextafter(angle, 4)))[1].any()
    assert constrain(surface, SeamOptions(sharp=np.nextafter(angle, 0)))[1].all()
    assert not constrain(surface, SeamOptions())[1].any()


def test_edges_between_groups_are_seams_where_that_is_asked_for() -> None:
    surface = surface_of(*shapes.grid(5, 3))
    group = (surface.points[surface.faces].mean(1)[:, 0] > 0.5).astype(np.int64)
    forced = constrain(surface, SeamOptions(groups=group, cut_groups=True))[1]
    x = surface.points[ends(surface)][:, :, 0]
    assert np.array_equal(forced, (x == 0.5).all(1))
    assert not constrain(surface, SeamOptions(groups=group))[1].any()
    # faces of the mesh, of which the surface may have lost some
    again = dataclasses.replace(surface, source=surface.source + 1)
    shifted = np.r_[7, group]
    assert np.array_equal(constrain(again, SeamOptions(groups=shifted, cut_groups=True))[1], forced)


def test_seams_of_the_file_add_up_with_named_ones_but_for_forbidden_ones() -> None:
    surface = surface_of(*shapes.grid(4, 4))
    pairs = np.sort(ends(surface), 1)
    start = np.zeros(len(pairs), bool)
    start[[2, 5, 9]] = True
    options = SeamOptions(start=start, cut=pairs[[5, 11]], no_cut=pairs[[9, 12]])
    closed, forced, notes = constrain(surface, options)
    assert np.flatnonzero(forced).tolist() == [2, 5, 11]
    assert np.flatnonzero(closed.locked).tolist() == [9, 12]
    assert not surface.locked.any(), "the surface given stays as it was"
    assert notes == []


def test_edges_inside_polygons_are_neither_cut_nor_a_contradiction() -> None:
    points, faces = shapes.grid(3, 3)
    surface = repair(Mesh(points, faces, polygons=np.arange(len(faces)) // 2))[0]
    pairs = np.sort(ends(surface), 1)
    inner, free = np.flatnonzero(surface.locked), np.flatnonzero(~surface.locked)
    assert len(inner) == 4
    options = SeamOptions(cut=pairs[np.r_[inner[:2], free[0]]], no_cut=pairs[inner])
    closed, forced, notes = constrain(surface, options)
    assert np.flatnonzero(forced).tolist() == [free[0]]
    assert np.array_equal(closed.locked, surface.locked)
    assert notes == ["2 of the edges of --seams lie inside a polygon and were not cut"]
    everything = SeamOptions(start=np.ones(len(pairs), bool), sharp=0.0)
    assert np.array_equal(constrain(surface, everything)[1], ~surface.locked)
