"""Moves tried: exact where layouts fit together, else relaxed, and refused where they cannot be good."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.core.workers import in_parts
from circparam.seams.evaluate import Demands, Moves, Trial, try_moves
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.solvers.newton import RelaxOptions
from circparam.solvers.objective import chart_energies
from tests.support import shapes
from tests.support.atlases import cut_between, surface_of, uncut, whole
from tests.support.charts import too_near

DEMANDS = Demands(1.05)
LIMIT = np.array(1.05)
FINE = RelaxOptions(tolerance=1e-10, max_iterations=200)


def tried(moves: Moves, demands: Demands) -> Trial:
    return try_moves(moves, demands, Monitor())


def halves(*parts: tuple, angle: float = 0.8) -> Moves:
    """Every part cut in two at x = 0.5 of its own and laid out by itself, the right side turned and moved."""
    apart = [(p + np.array([0, 2.0 * k, 0]), f) for k, (p, f) in enumerate(parts)]
    surface = surface_of(*shapes.join(*apart))
    number = np.repeat(np.arange(len(parts)), [len(f) for _, f in parts])
    right = np.concatenate([p[f].mean(1)[:, 0] > 0.5 for p, f in parts])
    atlas = cut_between(surface, 2 * number + right)
    lay_out_fresh(atlas, None, FINE)
    c, s = np.cos(angle), np.sin(angle)
    moved = atlas.corners @ np.array([[c, s], [-s, c]]) + np.array([3.0, -2.0])
    corners = np.where(right[:, None, None], moved, atlas.corners)
    joined = whole(surface).cut_mesh()
    assert joined.n_charts == len(parts)
    return Moves.joining(joined, corners, right.astype(np.int64))


def hill(height: float) -> tuple[np.ndarray, np.ndarray]:
    points, faces = shapes.grid(9, 9)
    away = ((points[:, :2] - 0.5) ** 2).sum(1)
    return points + np.outer(height * np.exp(-away / 0.05), [0, 0, 1]), faces


@pytest.mark.parametrize(("share", "good"), [(1.6, True), (1.05, True), (0.95, False)])
def test_a_union_is_good_where_its_best_is_below_the_bound(share: float, good: bool) -> None:
    """It is relaxed as far as that needs, and the lower bound of the energy is one."""
    best = float(lay_out_fresh(uncut(*hill(0.3)), None, FINE).energy[0])
    bound = 1 + (best - 1) * share
    moves = halves(hill(0.3))
    trial = tried(moves, Demands(bound))
    assert trial.good(np.array(bound)).tolist() == [good]
    assert not trial.overlapping.any()
    assert trial.floor[0] <= best + 1e-9
    if good:
        assert trial.energy == pytest.approx(chart_energies(moves.cut_mesh, trial.uv))


def spiral(turn: float) -> Moves:
    """Both halves of a flat ring of an angle; beyond a full turn the union covers itself."""
    surface = surface_of(*shapes.wound(turn, 80))
    right = (np.arange(len(surface.faces)) // 6 > 40).astype(np.int64)
    atlas = cut_between(surface, right)
    lay_out_fresh(atlas, None, FINE)
    return Moves.joining(whole(surface).cut_mesh(), atlas.corners, right)


@pytest.mark.parametrize(("turn", "good"), [(5.5, True), (8.0, False)])
def test_unions_that_lie_on_themselves_are_refused(turn: float, good: bool) -> None:
    trial = tried(spiral(turn), DEMANDS)
    assert trial.good(LIMIT).tolist() == [good]
    assert trial.energy[0] <= 1.05, "they are not distorted"


def test_parts_that_only_touch_are_pushed_apart() -> None:
    moves = spiral(2 * np.pi - 0.001)
    trial = tried(moves, DEMANDS)
    assert trial.good(LIMIT).all()
    assert not too_near(moves.cut_mesh, trial.uv, DEMANDS.margin / 2).any()
    assert chart_energies(moves.cut_mesh, trial.uv)[0] <= DEMANDS.bound
    assert not tried(moves, Demands(1.05, margin=0.5)).good(LIMIT).any(), "no room for that much"


def test_moves_tried_in_parts_are_those_tried_at_once() -> None:
    """Thousands of faces are shared out; what comes back stands at the place of its move."""
    sheets = [shapes.grid(30 + k, 30) for k in range(8)]
    moves = halves(*sheets, hill(0.6))
    assert len(in_parts(moves.cut_mesh.chart)) > 1
    trial = tried(moves, DEMANDS)
    assert trial.good(LIMIT).tolist() == [True] * 8 + [False]
    assert trial.energy[:8] == pytest.approx(np.ones(8), abs=1e-6)
    energy = chart_energies(moves.cut_mesh, trial.uv)
    assert trial.energy[:8] == pytest.approx(energy[:8])
