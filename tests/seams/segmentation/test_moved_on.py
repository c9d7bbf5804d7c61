"""Two charts moved onto each other as they are, and what merging makes of it."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation import merge
from circparam.seams.segmentation.glues import Glues
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.moved_on import crossings_as_they_are
from circparam.seams.segmentation.state import Arcs, arcs_of
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, middles, surface_of


def candidates(atlas: Atlas) -> tuple[Arcs, Glues]:
    n, chart = atlas.charts()
    arcs = arcs_of(atlas, chart)
    merger = Merger(atlas, MergeOptions(1.05), np.zeros(len(atlas.cut), bool))
    return arcs, merger._glues(arcs, chart, n)


def by_hand(atlas: Atlas, glued: np.ndarray, left: int, right: int) -> int:
    """The same for one candidate: the plane as complex numbers, pair by pair. glued: edges."""
    chart = atlas.charts()[1]
    z = atlas.corners.reshape(-1, 2) @ [1, 1j]

    def ends(h: int) -> tuple[complex, complex]:
        return z[h], z[h - 2 if h % 3 == 2 else h + 1]

    here, there = [], []
    for i, j in atlas.surface.edges[glued]:
        i, j = (i, j) if chart[i // 3] == left else (j, i)
        here.append(ends(i))
        there.append(ends(j)[::-1])  # it runs the other way
    a, b = np.array(here), np.array(there)
    turn = ((a[:, 1] - a[:, 0]) * (b[:, 1] - b[:, 0]).conj()).sum()
    turn /= abs(turn)
    rim = np.r_[atlas.surface.edges[atlas.cut & ~glued].ravel(), atlas.surface.boundary]
    mine = [ends(h) for h in rim if chart[h // 3] == left]
    theirs = [
        tuple(turn * (x - b.mean()) + a.mean() for x in ends(h))
        for h in rim
        if chart[h // 3] == right
    ]

    def side(s: complex, e: complex, x: complex) -> float:
        return float(((e - s).conjugate() * (x - s)).imag)

    return sum(
        side(p, q, r) * side(p, q, s) < 0 and side(r, s, p) * side(r, s, q) < 0
        for p, q in mine
        for r, s in theirs
    )


@pytest.mark.parametrize("seed", range(3))
def test_crossings_are_those_of_every_pair_of_segments(seed: int) -> None:
    """On a ball in eight charts, each laid out somewhere and jagged; of single arcs and of all of a pair."""
    rng = np.random.default_rng(seed)
    points, faces = shapes.icosphere(3)
    surface = surface_of(*shapes.noisy(points, faces, 0.05, seed))
    x, y, z = (middles(surface) @ shapes.rotation(seed)).T
    atlas = cut_between(surface, (np.abs(x) > 0.5) + 2 * (y > 0) + 4 * (z > 0.2))
    lay_out_fresh(atlas, None, RelaxOptions(tolerance=1e-2, max_iterations=5))
    cut_mesh, uv = atlas.open()
    atlas.scatter(cut_mesh, uv + rng.normal(size=uv.shape) * 0.15)  # so that boundaries cross
    n, chart = atlas.charts()
    angle, place = rng.uniform(0, 6, n), rng.normal(size=(n, 2)) * 3
    c, s = np.cos(angle)[chart][:, None], np.sin(angle)[chart][:, None]
    u, v = atlas.corners[..., 0], atlas.corners[..., 1]
    atlas.corners = np.stack([c * u - s * v, s * u + c * v], 2) + place[chart][:, None]
    arcs, glues = candidates(atlas)
    number = len(arcs.left)
    every = np.r_[np.arange(number), number + np.unique(glues.pair)]
    every = every[glues.left[every] != glues.right[every]]
    found = crossings_as_they_are(atlas, arcs, glues, every, chart)
    wanted = [
        by_hand(
            atlas,
            glues.glued(arcs, every[[k]], len(atlas.cut)),
            int(glues.left[every[k]]),
            int(glues.right[every[k]]),
        )
        for k in range(len(every))
    ]
    assert found.tolist() == wanted
    assert 0 < np.count_nonzero(found) < len(found)
    assert found.max() > 2


def strips(rise: float | None) -> tuple[Atlas, Merger]:
    """A sheet in three strips that fit together as they lie, and what merges them."""
    surface = surface_of(*shapes.grid(9, 9))
    atlas = as_it_lies(cut_between(surface, np.digitize(middles(surface)[:, 0], [0.25, 0.6])))
    options = MergeOptions(1.05, margin=0.0, rise=rise)
    return atlas, Merger(atlas, options, np.zeros(len(atlas.cut), bool))


@pytest.mark.parametrize("rise", [None, 1e-3])
def test_what_crosses_too_often_is_not_laid_out_where_there_is_hardly_any_room(
    rise: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The left two strips are said to; without a bound on what unions may add nothing is asked."""
    atlas, merger = strips(rise)
    asked: list[int] = []

    def crossings(a: Atlas, arcs: Arcs, glues: Glues, chosen: np.ndarray, chart: np.ndarray):
        asked.extend(chosen.tolist())
        first = chart[np.argmin(middles(a.surface)[:, 0])]
        at_first = (glues.left[chosen] == first) | (glues.right[chosen] == first)
        return np.where(at_first, merge.CROSSED, merge.CROSSED - 1)

    monkeypatch.setattr(merge, "crossings_as_they_are", crossings)
    merger.run(Monitor())
    if rise is None:
        assert not asked
        assert atlas.charts()[0] == 1
        return
    assert atlas.charts()[0] == 2
    narrow = middles(atlas.surface)[:, 0] < 0.25
    assert len(np.unique(atlas.charts()[1][narrow])) == 1
    assert merger.tally == {"trials": 2, "topology": 0, "distortion": 0, "overlap": 1, "merged": 1}
    between = atlas.cut
    assert merger.failed.overlapped[0, between].all()
    assert merger.work >= len(atlas.surface.faces)


@pytest.mark.parametrize("rise", [None, 1e-3])
def test_charts_that_fit_are_merged_as_ever(rise: float | None) -> None:
    atlas, merger = strips(rise)
    merger.run(Monitor())
    assert atlas.charts()[0] == 1
