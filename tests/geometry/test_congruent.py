"""Components of one shape: every copy is found, none wrongly, whatever the order; corners lie on corners."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.geometry.congruent import find_congruent
from tests.support import shapes
from tests.support.assembly import Assembly, assemble, bolt, kinds


def found(a: Assembly, mirror: bool):
    """The congruent parts of an assembly, and the leading part of each part."""
    one = find_congruent(a.points, a.faces, a.part, np.zeros(len(a.faces), np.int64), mirror)
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
    one, lead = found(a, mirror)
    p = a.points[a.faces]
    q = a.points[a.faces.ravel()][one.corner]
    sides = [np.linalg.norm(x - x[:, [1, 2, 0]], axis=2) for x in (p, q)]
    np.testing.assert_allclose(*sides, atol=1e-6)
    if mirror:
        assert len(np.unique(lead)) == 8
    else:  # mirror images are copies of each other, and of nothing else
        same = a.kind[lead] == a.kind
        assert same.all()
        assert (a.mirrored[lead] == a.mirrored).all()


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


def test_a_round_shape_of_equal_distances_is_found() -> None:
    a = assemble([shapes.icosphere(2)], 5)
    assert len(np.unique(a.part[found(a, False)[0].copy])) == 4
