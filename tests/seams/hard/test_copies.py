"""Components that are copies of each other, and those that are nearly."""

from __future__ import annotations

import dataclasses

import numpy as np

from circparam.mesh.atlas import Atlas
from circparam.seams.hard.copies import find_copies, spread_copies
from tests.support import shapes
from tests.support.atlases import charts_of, surface_of
from tests.support.parts import PARTS


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
    atlas = charts_of(surface)
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


def fan(faces: int) -> tuple[np.ndarray, np.ndarray]:
    """So many triangles round a point, with a gap, the rim a little uneven."""
    a = np.arange(faces + 1) * 0.9
    r = 1 + 0.05 * np.arange(faces + 1)
    rim = np.stack([r * np.cos(a), r * np.sin(a), 0.1 * a], 1)
    k = 1 + np.arange(faces)
    return np.r_[[[0.0, 0, 0]], rim], np.stack([0 * k, k, k + 1], 1)


def test_charts_of_one_hold_for_all() -> None:
    """Cut and layout of what is no copy, spread: the others get the same, and one of its kind its own."""
    points, corners = fan(5)
    other = fan(4)
    far = np.array([5.0, 0, 0])
    parts = (points, corners), (other[0] + far, other[1]), (points + 2 * far, corners)
    surface = surface_of(*shapes.join(*parts))
    copies = find_copies(surface)
    assert copies.first.tolist() == [True] * 9 + [False] * 5
    assert copies.original.tolist() == [*range(9), *range(5)]
    part = Atlas(surface.part(copies.first), np.array([1, 0, 0, 1, 0, 1, 0], bool))
    part.corners = np.arange(9 * 6.0).reshape(9, 3, 2)
    whole = spread_copies(surface, copies, part)
    assert np.array_equal(whole.corners, part.corners[copies.original])
    cut = {tuple(e // 3): bool(c) for e, c in zip(part.surface.edges, part.cut, strict=True)}
    for e, c in zip(surface.edges // 3, whole.cut, strict=True):
        assert c == cut[tuple(copies.original[e])]
