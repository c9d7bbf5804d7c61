"""Components of one shape: every copy is found, none wrongly, whatever the order; corners lie on corners."""

import numpy as np
import pytest

from circparam.geometry.congruent import find_congruent
from circparam.geometry.congruent_flats import find_flats
from tests.support import shapes
from tests.support.assembly import Assembly, assemble, bolt, kinds, other_triangles


def found(a: Assembly, mirror: bool, flats: bool = True):
    """The congruent parts of an assembly, and the leading part of each part."""
    kind = np.zeros(len(a.faces), np.int64)
    one = find_congruent(a.points, a.faces, a.part, kind, mirror, flats)
    lead = np.zeros(len(a.kind), np.int64)
    lead[a.part] = a.part[one.corner[:, 0] // 3]
    return one, lead


def test_every_copy_of_300_parts_of_40_kinds_is_found_and_none_wrongly() -> None:
    a = assemble(kinds(40), 300)
    one, lead = found(a, False)
    first = np.unique(a.kind, return_index=True)[1]
    np.testing.assert_array_equal(lead, first[a.kind])
    assert one.copy.sum() == (lead != np.arange(300))[a.part].sum()
    assert not one.turned.any()


@pytest.mark.parametrize("mirror", [False, True])
def test_corners_of_copies_lie_as_those_of_the_leader(mirror: bool) -> None:
    a = assemble(kinds(8), 60, seed=1, mirror=0.4)
    one, lead = found(a, mirror, flats=False)
    p = a.points[a.faces]
    q = a.points[a.faces.ravel()][one.corner]
    sides = [np.linalg.norm(x - x[:, [1, 2, 0]], axis=2) for x in (p, q)]
    np.testing.assert_allclose(*sides, atol=1e-6)
    if mirror:
        assert len(np.unique(lead)) == 8
    else:  # by their triangles, mirror images are copies of each other, and of nothing else
        same = a.kind[lead] == a.kind
        assert same.all()
        assert (a.mirrored[lead] == a.mirrored).all()
        # as prisms and turned parts, they are mirror images of themselves
        assert len(np.unique(found(a, False)[1])) == 8


def test_parts_that_differ_a_little_are_no_copies() -> None:
    p, f = bolt()
    longer = p.copy()
    longer[np.argmax(np.linalg.norm(p, axis=1))] *= 1.001
    a = assemble([(p, f), (longer, f)], 2)
    assert not found(a, True)[0].copy.any()


def test_labels_part_copies() -> None:
    a = assemble([bolt()], 4)
    one = find_congruent(a.points, a.faces, a.part, a.part // 2)
    assert len(np.unique(a.part[one.copy])) == 2


def plates(mirror: float = 0.0, seed: int = 0) -> Assembly:
    """Plates with a hole and rods of eight sides, ten of each, all with diagonals of their own."""
    shapes = [kinds(4)[3], kinds(4)[2]]
    own = [(p, other_triangles(p, f, seed + k)) for k in range(10) for p, f in shapes]
    return assemble(own, 20, seed=seed, mirror=mirror)


@pytest.mark.parametrize("mirror", [False, True])
def test_copies_with_other_triangles_in_their_flats_are_found(mirror: bool) -> None:
    a = plates(mirror=0.5 if mirror else 0.0)
    triangles = [
        np.sort(np.linalg.norm(np.diff(a.points[a.faces[a.part == k]], axis=1), axis=2).ravel())
        for k in (0, 2)
    ]
    assert not np.allclose(*triangles)
    one, lead = found(a, mirror)
    assert len(np.unique(lead)) == 2
    assert (a.kind[lead] % 2 == a.kind % 2).all()
    away = np.linalg.norm(a.points[a.faces] - centres(a)[a.part][:, None], axis=2)
    there = away.ravel()[one.corner]
    np.testing.assert_allclose(away, there, atol=1e-5)
    leads = one.whole >= 0
    assert not (leads & one.copy).any()


def centres(a: Assembly) -> np.ndarray:
    """(parts, 3) centroid of the surface of each part."""
    p = a.points[a.faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    total = np.bincount(a.part, area)
    middle = p.mean(1) * area[:, None]
    out: np.ndarray = np.stack([np.bincount(a.part, middle[:, k]) / total for k in range(3)], 1)
    return out


def test_a_flat_that_ends_elsewhere_is_no_copy() -> None:
    p, f = kinds(4)[3]
    bent = p.copy()
    corner = int(np.argmax(p @ [1.0, 0.3, 0.2]))
    bent[corner] += [0.0, 0.0, 1e-3]
    a = assemble([(p, f), (bent, other_triangles(p, f))], 2)
    assert not found(a, True)[0].copy.any()


def test_a_finely_bent_surface_has_no_flats() -> None:
    p, f = shapes.icosphere(4)
    flats = find_flats(p, f, np.full(len(f), 1e-2), np.zeros(len(f), np.int64))
    assert len(np.unique(flats.label)) == len(f)
    box, squares = shapes.cube(4)
    flats = find_flats(box, squares, np.full(len(squares), 1e-6), np.zeros(len(squares), np.int64))
    assert len(np.unique(flats.label)) == 6
