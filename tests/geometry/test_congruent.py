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


@pytest.mark.parametrize("level", [2, 3, 4])
def test_spheres_whose_vertices_are_nearly_alike_are_copies(level: int) -> None:
    """All vertices lie equally far out; the twelve of five faces are the ones to try."""
    a = assemble([shapes.icosphere(level)], 4)
    one, lead = found(a, False)
    assert not lead.any()
    assert one.copy.sum() == 3 * 20 * 4**level


@pytest.mark.parametrize("other", [False, True], ids=["the same triangles", "other triangles"])
def test_parts_that_differ_a_little_are_no_copies(other: bool) -> None:
    """One corner lies a thousandth elsewhere."""
    p, f = kinds(4)[3] if other else bolt()
    moved = p.copy()
    moved[np.argmax(p @ [1.0, 0.3, 0.2])] += [0.0, 0.0, 1e-3]
    a = assemble([(p, f), (moved, other_triangles(p, f) if other else f)], 2)
    assert not found(a, True)[0].copy.any()


def test_labels_part_copies() -> None:
    a = assemble([bolt()], 4)
    one = find_congruent(a.points, a.faces, a.part, a.part // 2)
    assert len(np.unique(a.part[one.copy])) == 2


@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("mirror", [0.0, 0.5])
def test_flats_with_other_triangles_are_copies_at_any_size(mirror: float, scale: float) -> None:
    p, f = kinds(4)[3]
    own = [(scale * p, other_triangles(p, f, k)) for k in range(6)]
    a = assemble(own, 6, mirror=mirror, gap=5 * scale)
    one, lead = found(a, mirror > 0)
    assert (lead == 0).all()
    assert one.copy.sum() == 5 * len(f)
    there = a.points[a.faces].reshape(-1, 3)[one.corner]
    sides = [np.linalg.norm(c - np.roll(c, 1, 1), axis=2) for c in (a.points[a.faces], there)]
    np.testing.assert_allclose(*sides, rtol=1e-9)


def test_a_finely_bent_surface_has_no_flats() -> None:
    p, f = shapes.icosphere(4)
    flats = find_flats(p, f, np.full(len(f), 1e-2), np.zeros(len(f), np.int64))
    assert len(np.unique(flats.label)) == len(f)
    box, squares = shapes.cube(4)
    flats = find_flats(box, squares, np.full(len(squares), 1e-6), np.zeros(len(squares), np.int64))
    assert len(np.unique(flats.label)) == 6
