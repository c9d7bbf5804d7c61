"""Whatever moves the seams of an atlas, on whatever shape, keeps what is promised of every atlas."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas, SeamPrices
from circparam.seams.evaluate import Demands
from circparam.seams.moves.reroute import move_seams
from circparam.seams.segmentation.enforce import enforce
from circparam.seams.segmentation.layout import judge
from circparam.seams.segmentation.tail import limit_stretch
from circparam.seams.segmentation.weigh import Limits
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import assert_promises, energies, voronoi

SHAPES = {
    "ball": shapes.noisy(*shapes.icosphere(3), 0.01, 0),
    "ring": shapes.torus(24, 12),
    "tube": shapes.cylinder(around=12, along=8, caps=True),
    "bumps": shapes.bumped_disk(500, 0.5),
    "box": shapes.cube(8),
}


def cut(atlas: Atlas, bound: float) -> None:
    layouts = judge(*atlas.open())
    enforce(atlas, layouts, bound, RelaxOptions(), Monitor())


# those that only move seams keep the charts and cost no more; others may cut
MOVES = {"move": lambda atlas, bound: move_seams(atlas, Demands(bound, 0.001), Monitor())}
CUTS = {
    "hold stretch": lambda atlas, bound: limit_stretch(atlas, Limits(bound, 1.5), Monitor()),
    "enforce": cut,
}


def start(name: str, seeds: int) -> Atlas:
    """An atlas with prices between a half and one and a half of every edge."""
    plain = voronoi(SHAPES[name], seeds)
    none = np.zeros(len(plain.cut), bool)
    price = 1 + 0.5 * np.sin(np.arange(len(none)) * 1.7)
    return Atlas(plain.surface, plain.cut, plain.corners, SeamPrices(price, none, none, none))


def paid(atlas: Atlas) -> float:
    return float(atlas.lengths[atlas.cut].sum())


@pytest.mark.parametrize("seeds", [12, 24])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("move", MOVES)
def test_moves_keep_charts_and_cost_no_more(move: str, shape: str, seeds: int) -> None:
    atlas = start(shape, seeds)
    bound = float(energies(*atlas.open()).max()) + 1e-9  # no room left
    assert_promises(atlas, bound)
    count, before = atlas.charts()[0], paid(atlas)
    MOVES[move](atlas, bound)
    assert_promises(atlas, bound)
    assert atlas.charts()[0] <= count
    assert paid(atlas) <= before + 1e-9


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("move", CUTS)
def test_cuts_hold_charts_to_the_bound(move: str, shape: str) -> None:
    atlas = start(shape, 12)
    highest = float(energies(*atlas.open()).max())
    bound = 1 + 0.7 * (highest - 1) if move == "enforce" else highest + 0.02
    CUTS[move](atlas, bound)
    assert_promises(atlas, bound + 1e-9)
