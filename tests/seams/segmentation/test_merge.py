"""Merging charts: what is glued, what never is, and what is not tried again."""

from __future__ import annotations

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.seams import charts as module
from circparam.seams.segmentation import grow
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.unions import MergeOptions
from tests.support import shapes
from tests.support.atlases import surface_of


def test_unions_laid_out_in_two_halves_are_those_laid_out_at_once(monkeypatch) -> None:
    surface = surface_of(*shapes.icosphere(3))
    start = Atlas(surface, np.zeros(len(surface.edges), bool))
    grow.first_charts(start, grow.dual_graph(surface), 40)
    lay_out_fresh(start, None, module.ROUGH)
    monkeypatch.setattr("circparam.core.workers.HALVED", 100)
    merged = []
    for worker in (None, Worker(module.__name__, worth_it=False)):
        atlas = Atlas(surface, start.cut, start.corners)
        merger = Merger(atlas, MergeOptions(1.05), np.zeros(len(atlas.cut), bool), worker)
        assert merger.round(Monitor())
        merged.append((atlas, merger.tally))
    (once, tally), (halves, other) = merged
    assert tally == other
    assert 2 < tally["merged"] <= tally["trials"]
    assert np.array_equal(once.cut, halves.cut)
    assert np.allclose(once.corners, halves.corners, atol=1e-9)
