"""Arms cut off sprawling charts: where boxes tell that it is worth the seam, and nowhere else."""

from typing import Any

import numpy as np
import pytest

import circparam
from circparam.core.monitor import Monitor
from circparam.formats.memory import from_arrays
from circparam.mesh.atlas import Atlas
from circparam.pipeline import fuller_page
from circparam.pipeline.cascade import Cascade, CascadeRules
from circparam.pipeline.cut_plan import RATE
from circparam.pipeline.job import prepare
from circparam.pipeline.options import Options
from circparam.pipeline.sprawl import KEPT, Trimmed, Trimmer
from tests.support import shapes

LONG, WIDE = 20, 2


def letters(count: int, long: int = LONG, wide: int = WIDE) -> shapes.Shape:
    """Letters L of unit squares beside each other: two arms ``long`` and ``wide``, flat."""
    points, faces = shapes.grid(long + 1, long + 1, float(long), float(long))
    centre = points[faces].mean(1)
    one = shapes.compact(points, faces[(centre[:, 0] < wide) | (centre[:, 1] < wide)])
    moved = [one[0] + np.array([2.0 * long * k, 0, 0]) for k in range(count)]
    return np.concatenate(moved), np.concatenate([one[1] + len(one[0]) * k for k in range(count)])


def flat_atlas(shape: shapes.Shape) -> Atlas:
    points, faces = shape
    surface = prepare(from_arrays(points, faces), None, Options(), Monitor()).surface
    corners = points[:, :2][surface.from_file(faces)]
    return Atlas(surface, np.zeros(len(surface.edges), bool), corners)


def trimmer(shape: shapes.Shape, longer: float = np.inf, cuts: int = 100) -> Trimmer:
    atlas = flat_atlas(shape)
    options = Options(pack_splits=cuts)  # asked for: flats may be cut
    cascade = Cascade(atlas, CascadeRules(bound=1.05))
    cutter = fuller_page.atlas_cutter(cascade, *atlas.open(), options)
    return Trimmer(cutter, longer, np.inf, cuts)


def trimmed(shape: shapes.Shape, longer: float = np.inf, cuts: int = 100) -> Trimmed:
    return trimmer(shape, longer, cuts).run(Monitor())


def least(points: np.ndarray) -> tuple[float, float]:
    """Area of the least bounding box of points (k, 2), and side of the least square, over 16 directions."""
    found = []
    for turn in np.arange(16) * (np.pi / 32):
        axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        found.append(np.ptp(points @ axes, axis=0))
    return min(float(e.prod()) for e in found), min(float(e.max()) for e in found)


def test_a_letter_is_cut_at_its_corner_and_worth_what_squares_tell() -> None:
    """Its least square has the side of its arms; that of one arm alone stands on a corner."""
    found = trimmed(letters(1), cuts=1)
    assert found.cuts == 1
    areas = [float(g.atlas.surface.areas.sum()) for g in found.grounds]
    assert min(areas) >= (LONG - WIDE) * WIDE
    assert sum(areas) == pytest.approx(WIDE * (2 * LONG - WIDE))
    assert found.before == pytest.approx(2 * LONG)
    assert WIDE <= found.length - found.before < 1.5 * WIDE
    side = max(least(g.opened.uv)[1] for g in found.grounds)
    assert side < 1.1 * (LONG + WIDE) / np.sqrt(2)
    saved = np.log(LONG**2 / side**2) - RATE * np.log(found.length / found.before)
    assert found.value == pytest.approx(saved, rel=1e-2)


def test_of_many_charts_the_sum_of_boxes_counts() -> None:
    """30 letters: their page is what they cover and a share of what their boxes hold besides."""
    n = 30
    found = trimmed(letters(n), cuts=n)
    assert found.cuts == n
    assert len(found.grounds) == 2 * n
    area = n * WIDE * (2 * LONG - WIDE)
    after = sum(least(g.opened.uv)[0] for g in found.grounds)
    saved = np.log((area + KEPT * (n * LONG**2 - area)) / (area + KEPT * (after - area)))
    assert found.value == pytest.approx(
        saved - RATE * np.log(found.length / found.before), rel=1e-2
    )


@pytest.mark.parametrize(
    ("longer", "count"), [(1.9 * WIDE, 1), (6.0 * WIDE, 4), (1.2 * WIDE, 0), (0.9 * WIDE, 0)]
)
def test_seams_grow_by_no_more_than_they_may(longer: float, count: int) -> None:
    found = trimmed(letters(12), longer=longer)
    assert count <= found.cuts <= longer / WIDE
    assert count * WIDE <= found.length - found.before <= longer


def test_what_leaves_nothing_empty_is_left() -> None:
    squares, faces = shapes.grid(5, 5, 4.0, 4.0)
    many = np.concatenate([squares + np.array([9.0 * k, 0, 0]) for k in range(30)])
    found = trimmed((many, np.concatenate([faces + len(squares) * k for k in range(30)])))
    assert (found.cuts, found.value, found.grounds) == (0, 0.0, [])


def test_letters_fill_their_page() -> None:
    """Cut at their corners, all in one unwrap; every seam is about as long as an arm is wide."""
    shape = letters(30)
    options: dict[str, Any] = {"resolution": 512, "padding": 1, "effort": 0.1}
    before = circparam.unwrap(shape, pack_splits=0, **options)
    after = circparam.unwrap(shape, pack_splits=30, **options)
    old, new = before.measures, after.measures
    cuts = int(new["charts"] or 0) - int(old["charts"] or 0)
    assert 20 <= cuts <= 30
    assert float(new["pack"] or 0) > 1.1 * float(old["pack"] or 0)
    assert (new["flips"], new["overlap"], new["mirrored"]) == (0, 0, 0)
    root = np.sqrt(30 * WIDE * (2 * LONG - WIDE))
    assert cuts * WIDE <= float(new["seam_length"] or 0) * root < 1.5 * cuts * WIDE
    assert any(f"{cuts} cuts for a fuller page" in note for note in after.notes)
