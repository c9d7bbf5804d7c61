"""Flats of surfaces that are not hard as a whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circparam.mesh.atlas import Atlas
from circparam.seams.hard.flats import DEAR, PAIR, flat_prices, real_flats, with_flats
from circparam.seams.hidden import hiding_prices
from circparam.seams.segmentation.shorten import edge_costs
from tests.support import shapes
from tests.support.atlases import surface_of, uncut
from tests.support.parts import PARTS

RING = shapes.torus(24, 12)  # plane quads, each cut in two
TUBE = shapes.cylinder(around=12, along=6)  # its quads form flats from end to end


def ball(seed: int = 0) -> shapes.Shape:
    """A round surface whose faces are coplanar by chance only."""
    return shapes.noisy(*shapes.icosphere(4), 0.002, seed)


@pytest.mark.parametrize(("shape", "faces"), [(RING, 2), (TUBE, 12)])
def test_what_is_coplanar_by_design_is_a_flat(shape: shapes.Shape, faces: int) -> None:
    surface = surface_of(*shape)
    flat, size = real_flats(surface)
    a, b = surface.edges.T // 3
    assert np.array_equal(flat, (surface.normals[a] * surface.normals[b]).sum(1) > 1 - 1e-9)
    assert flat.sum() == len(shape[1]) * (faces - 1) // faces
    assert (size[flat] == faces).all()


@given(st.integers(0, 50))
def test_faces_that_are_coplanar_by_chance_are_no_flats(seed: int) -> None:
    surface = surface_of(*ball(seed))
    assert not real_flats(surface)[0].any()
    assert not with_flats(surface).any()


def test_each_component_is_judged_alone() -> None:
    surface = surface_of(*shapes.join(RING, ball()))
    flat, _ = real_flats(surface)
    of_ring = surface.edges[:, 0] // 3 < len(RING[1])
    assert flat[of_ring].sum() == len(RING[1]) // 2
    assert not flat[~of_ring].any()


@pytest.mark.parametrize(("shape", "factor"), [(RING, PAIR), (TUBE, DEAR)])
def test_flats_are_dear_and_all_else_costs_what_it_did(shape: shapes.Shape, factor: float) -> None:
    atlas = uncut(*shape)
    prices = flat_prices(atlas.surface)
    assert prices is not None
    paid = prices.price * atlas.surface.edge_lengths / edge_costs(atlas)
    assert paid == pytest.approx(np.where(real_flats(atlas.surface)[0], factor, 1.0))


def test_a_flat_is_dearer_than_its_rim_however_many_see_the_rim() -> None:
    """Prices of visibility make the rim of a flat up to four times as dear as the flat is."""
    part = PARTS["cube"]()
    surface = surface_of(part.points, part.faces)
    flat, _ = real_flats(surface)
    seen = replace(surface, price=hiding_prices(surface, 0.5))
    assert flat.any()
    assert seen.price[~flat].max() > 2
    costs = []
    for one in (surface, seen):
        atlas = Atlas(one, np.zeros(len(flat), bool), prices=flat_prices(one))
        costs.append(atlas.costs / one.edge_lengths)
    assert costs[1][flat].min() > costs[1][~flat].max()
    # visibility counts once
    assert (costs[1] / costs[0])[~flat] == pytest.approx(seen.price[~flat])
