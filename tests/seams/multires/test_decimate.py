"""The proxy: its topology, and the cell of every fine vertex."""

from __future__ import annotations

import numpy as np

from circparam.seams.multires.decimate import decimate
from tests.support import shapes
from tests.support.atlases import surface_of


def test_the_proxy_keeps_the_genus_and_maps_every_vertex() -> None:
    surface = surface_of(*shapes.torus(60, 30))
    proxy = decimate(surface, 600)
    none = np.zeros(len(proxy.surface.edges), bool)
    assert proxy.surface.cut_mesh(none).euler().tolist() == [0]
    assert len(proxy.surface.faces) < 700
    assert proxy.cell.min() >= 0
    assert set(proxy.cell.tolist()) == set(range(len(proxy.surface.points)))
