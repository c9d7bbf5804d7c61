"""Prices of edges by shape, visibility and weights, and what they do to an atlas."""

from dataclasses import replace

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.visibility import edge_shares, visible_share
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.charts import charts
from circparam.seams.options import HIDDEN, SeamOptions
from circparam.seams.prices import (
    DIRECTIONS,
    PIXELS,
    edge_costs,
    edge_prices,
    visibility_prices,
)
from tests.support import shapes
from tests.support.atlases import energies, surface_of


def grooved(level: int = 4) -> Surface:
    """A ball with a deep and narrow groove along a meridian that winds: seams round the ball may hide in it."""
    p, f = shapes.icosphere(level)
    turn = np.abs(p[:, 0] - 0.25 * np.sin(3 * np.arctan2(p[:, 2], p[:, 1])))
    dent = 0.35 * np.exp(-((turn / 0.09) ** 2))
    return surface_of(p * (1 - dent)[:, None], f)


def decided(surface: Surface, strength: float) -> Atlas:
    found = charts(surface, SeamOptions(hide_seams=strength), Monitor())
    return Atlas(surface, found.cut, found.uv)


def test_prices_are_one_at_no_strength_and_fall_with_the_share_that_sees_an_edge() -> None:
    surface = grooved(3)
    none, half, full = (visibility_prices(surface, x, Monitor()) for x in (0.0, 0.5, 1.0))
    assert none == pytest.approx(1)
    assert full == pytest.approx(half**2)
    # processes look along some of the directions each
    share = edge_shares(surface, DIRECTIONS, PIXELS)
    order = np.argsort(share)
    assert (np.diff(full[order]) > -1e-12).all()
    assert 0 < full.min() < 0.01, "hidden edges are cheap, but not for nothing"
    assert np.interp(0.5, share[order], full[order]) == pytest.approx(1, abs=0.02)
    h = surface.edges[:, 0]
    middle = surface.points[surface.faces].reshape(-1, 3)[h]
    deep = np.linalg.norm(middle, axis=1) < 0.75
    high = np.linalg.norm(middle, axis=1) > 0.98
    assert np.median(half[deep]) < 0.6 * np.median(half[high])


@pytest.mark.parametrize("level", [3, 4])  # decided on the mesh itself, and on its proxy
def test_seams_hide_in_a_groove_and_every_chart_is_good(level: int) -> None:
    surface = grooved(level)
    plain, hidden = decided(surface, 0.0), decided(surface, HIDDEN)
    shares = [visible_share(surface, a.cut) for a in (plain, hidden)]
    assert None not in shares
    assert shares[1] < shares[0]
    assert hidden.charts()[0] <= plain.charts()[0]
    assert hidden.seam_length < 1.25 * plain.seam_length
    cut_mesh = hidden.cut_mesh()
    assert not not_disks(cut_mesh).any()
    assert (energies(cut_mesh, hidden.gather(cut_mesh)) <= 1.05).all()


def test_a_flat_is_dearer_than_its_rim_however_many_see_the_rim() -> None:
    """Prices of visibility make the rim of a flat more than twice as dear as the flat is."""
    surface = surface_of(*shapes.cube(2))
    prices = edge_prices(surface)
    seen = replace(surface, price=visibility_prices(surface, 0.5, Monitor()))
    assert prices.flat.any()
    assert seen.price[~prices.flat].max() > 2
    uncut = np.zeros(len(surface.edges), bool)
    plain, hidden = (edge_costs(Atlas(s, uncut, prices=prices)) for s in (surface, seen))
    paid = hidden / surface.edge_lengths
    assert paid[prices.flat].min() > paid[~prices.flat].max()
    assert (hidden / plain)[~prices.flat] == pytest.approx(seen.price[~prices.flat])
