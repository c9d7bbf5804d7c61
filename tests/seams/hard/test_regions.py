"""Which surfaces are hard, their flats and normals, and what seams cost there."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.seams.hard.charts import unrolls_in_part
from circparam.seams.hard.regions import flats, hard_components, level_edges, surely_hard, turns
from circparam.seams.prices import edge_prices
from tests.support import shapes
from tests.support.atlases import surface_of
from tests.support.parts import PARTS, circle, extrude, lathe, rectangle


def test_a_fine_tube_is_not_a_flat() -> None:
    """Its faces turn less than flats do, one by one."""
    surface = surface_of(*shapes.cylinder(around=900, along=1))
    angle, _ = turns(surface)
    assert angle.max() < np.radians(0.5)
    label, _ = flats(surface)
    assert label.max() > 100


def test_a_curved_row_of_quads_is_level_inside_each_quad() -> None:
    """Rows of them along a bent tube turn less than flats do, but no row is level. Files round their points."""
    points, faces = shapes.torus(nu=1000, nv=12)
    surface = surface_of(points.round(6), faces)
    assert not flats(surface)[1].any()
    level = level_edges(surface)
    assert level.sum() == len(faces) // 2
    assert (np.bincount(surface.sides[:, level].ravel(), minlength=len(faces)) == 1).all()


def test_a_fine_round_shape_has_no_level_edges() -> None:
    points, faces = shapes.grid(200, 200, width=0.2, height=0.2)
    x, y, _ = points.T
    surface = surface_of(np.stack([x, y, np.sqrt(1 - x**2 - y**2)], 1).round(6), faces)
    assert turns(surface)[0].max() < np.radians(0.5)
    assert not level_edges(surface).any()


@pytest.mark.parametrize("name", PARTS)
def test_parts_are_hard_and_unroll_between_their_creases(name) -> None:
    surface = surface_of(PARTS[name]().points, PARTS[name]().faces)
    assert hard_components(surface).all()
    assert unrolls_in_part(surface, 1.05).all()


def on_a_flat(points: np.ndarray, faces: np.ndarray) -> shapes.Shape:
    """As a scan is cut off by the plane that it stands on."""
    return np.where(points < [-9, -9, -0.8], [0, 0, -0.8], points), faces


@pytest.mark.parametrize(
    "shape",
    [
        shapes.icosphere(1),
        shapes.icosphere(3),
        shapes.torus(48, 32),
        shapes.bumped_disk(),
        shapes.noisy(*shapes.icosphere(4), amount=0.05),
        on_a_flat(*shapes.noisy(*shapes.icosphere(4), amount=0.05)),
        shapes.double_torus(),
    ],
)
def test_round_shapes_are_organic(shape) -> None:
    """Some end in large flats where they lie along an axis, but the rest does not unroll."""
    surface = surface_of(*shape)
    assert not (hard_components(surface) & unrolls_in_part(surface, 1.05)).any()


@pytest.mark.parametrize(
    ("shape", "sure"),
    [
        (shapes.rod(), False),  # facets that no crease bounds
        (shapes.stone(), False),  # faces that are no flats of several faces
        (shapes.cube(6), True),
        (shapes.grid(20, 20), True),  # bounded by the boundary
    ],
)
def test_flats_that_creases_or_boundaries_bound_are_surely_hard(shape, sure: bool) -> None:
    surface = surface_of(*shape)
    assert hard_components(surface).all()
    assert surely_hard(surface).tolist() == [sure] * len(surface.faces)


def test_seams_are_dear_in_flats_and_cheap_on_sharp_edges() -> None:
    """And on concave ones cheaper still: the floor of a pocket against the rim of the plate."""
    part = extrude(rectangle(4.0, 2.0), (), 1.0, [(circle(48, 0.5), 0.5)])
    surface = surface_of(part.points, part.faces)
    prices = edge_prices(surface)
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


@pytest.mark.parametrize("around", [13, 15, 17])
def test_tubes_of_few_sides_are_hard_however_blunt_the_edges_along_them(around) -> None:
    """Between its rims, which are sharp, the mantle unrolls."""
    part = lathe(np.array([[0.6, 0.0], [1.0, 0.0], [1.0, 0.5], [0.6, 0.5]]), around)
    surface = surface_of(part.points, part.faces)
    assert 2 * np.pi / around > np.radians(20)  # its mantle is creased
    assert hard_components(surface).all()
