"""Cuts for a fuller page: made where a page so much fuller is worth the seam, and nowhere else."""

import numpy as np
import pytest

import circparam
from circparam.core.arrays import next_half_edge
from circparam.core.monitor import Monitor
from circparam.formats.memory import from_arrays
from circparam.geometry.distortion import chart_distortion, face_stretch
from circparam.mesh.atlas import Atlas
from circparam.pipeline import fallback, fuller_page
from circparam.pipeline.fallback import Cascade, CascadeRules
from circparam.pipeline.fuller_page import fill_page
from circparam.pipeline.job import prepare
from circparam.pipeline.options import Options
from circparam.seams.cost import COST
from circparam.seams.segmentation.weigh import share_over
from tests.support import shapes, unwrapped


def roll(length: int = 100, width: int = 10, rough: float = 0.05) -> Atlas:
    """A long tube of unit squares, slit along one line: one chart, a strip of unit squares."""
    points, faces = shapes.grid(length + 1, width + 1, float(length), float(width))
    uv = points[:, :2].copy()
    turn = 2 * np.pi * (uv[:, 1] % width) / width
    wave = 1 + rough * np.sin(2 * uv[:, 0]) * np.cos(2 * turn)
    round_ = np.stack([uv[:, 0], *(wave * width / (2 * np.pi) * [np.cos(turn), np.sin(turn)])], 1)
    job = prepare(from_arrays(round_, faces), None, Options(), Monitor())
    s = job.surface
    corners = uv[s.from_file(faces)]
    flat = corners.reshape(-1, 2)
    seam = (flat[s.edges[:, 0]] != flat[next_half_edge(s.edges[:, 1])]).any(1)
    return Atlas(s, seam, corners)


def filled(
    atlas: Atlas,
    most: int | None = None,
    least: int = 1,
    bound: float = 1.05,
    effort: float = 1.0,
) -> Cascade:
    cascade = Cascade(atlas, CascadeRules(bound=bound))
    options = Options(max_charts=most, min_chart_faces=least, resolution=512, effort=effort)
    return fill_page(cascade, options, Monitor())


def stretched(atlas: Atlas, columns: int) -> Atlas:
    """The strip with some of its columns drawn three times as long, and what lies behind them moved on."""
    x = atlas.corners[..., 0]
    out = np.where(x > 40, x + 2 * np.minimum(x - 40, columns), x)
    corners = np.stack([out, atlas.corners[..., 1]], 2)
    return Atlas(atlas.surface, atlas.cut.copy(), corners)


def test_cuts_leave_no_more_stretched_than_may_be() -> None:
    """Weights bring back what parts with scales of their own are stretched too much."""
    before, limits = roll(rough=0.0), Options(resolution=512)
    after = stretched(before, 2)
    assert fuller_page.stretch_kept(after, before, limits, 1.2, Monitor())
    cut_mesh, uv = after.open()
    assert float(share_over(cut_mesh, face_stretch(cut_mesh, uv), 2.0).sum()) <= 1e-3


def test_a_mesh_without_a_seam_gets_none() -> None:
    """The same strip, never rolled up."""
    whole = roll()
    opened = whole.surface.without_edges(whole.cut)
    flat = Atlas(opened, np.zeros(len(opened.edges), bool), whole.corners)
    assert filled(flat).atlas is flat


def cost(cascade: Cascade) -> float:
    """Seams, charts and page of a layout, which cuts of a strip change."""
    found = cascade.packing or fuller_page.packing(cascade, Options(resolution=512), Monitor())
    share = fuller_page.covered_share(found)
    return COST.finished(cascade.atlas.seam_length, cascade.atlas.charts()[0], 1.0, 0.0, share)


# a draft estimates pages: what a strip of 16 by 10 gains is too little for an estimate
@pytest.mark.parametrize(
    ("length", "effort"),
    [(16, 1.0), (24, 1.0), (200, 1.0), (24, 0.0), (200, 0.0)],
)
def test_cuts_lower_the_cost_of_the_atlas(length: int, effort: float) -> None:
    """Seams of any length are added if the page pays them, and none otherwise."""
    before = Cascade(roll(length), CascadeRules(bound=1.05))
    after = filled(before.atlas, effort=effort)
    cuts = after.atlas.charts()[0] - 1
    assert cost(after) < cost(before) if cuts else after.atlas is before.atlas
    assert cuts >= 1 if length >= 24 else cuts <= 1


@pytest.mark.parametrize("refine", [1, 3])
def test_a_cut_along_an_edge_is_as_long_as_the_edge(refine: int) -> None:
    """One edge of a cube is a seventh of its seams: one cut, which makes a page of two arms out of a cross."""
    result = circparam.unwrap(shapes.cube(refine))
    assert result.measures["charts"] == 2
    assert result.measures["seam_length"] == pytest.approx(8 / np.sqrt(6))
    assert result.measures["pack"] > 0.6


def test_there_are_no_more_charts_than_asked_for_and_none_too_small() -> None:
    before = roll()
    assert filled(before, most=1).atlas is before
    assert filled(before, most=2).atlas.charts()[0] == 2
    assert filled(before, least=1100).atlas is before  # of 2000 faces


def test_flats_are_cut_only_where_the_page_pays_five_times_the_seam() -> None:
    """Tubes of ten flat sides: no way across but through them. A short one stays whole."""
    short, long = roll(16, rough=0.0), roll(rough=0.0)
    assert filled(short).atlas is short
    after = filled(long)
    seam = after.atlas.seam_length - long.seam_length
    assert cost(after) + COST.flat * seam < cost(Cascade(long, CascadeRules(bound=1.05)))


def test_slivers_with_wide_gaps_are_packed_as_they_are() -> None:
    """A short tube seen from above, on a coarse lattice: slivers with wide gaps for their size."""
    turn, random = 2 * np.pi * np.arange(8) / 8, np.random.default_rng(10)
    ring = 1.1 * np.stack([np.cos(turn), np.sin(turn)], 1)
    flat = np.round(8 * (ring + random.uniform(-0.1, 0.1, (4, 8, 2)))).reshape(-1, 2) / 8
    low = (8 * np.arange(3)[:, None] + np.arange(8)).ravel()
    beside = low - low % 8 + (low + 1) % 8
    faces = np.vstack(
        [np.stack([low, beside + 8, low + 8], 1), np.stack([low, beside, beside + 8], 1)]
    )
    result = circparam.unwrap((np.pad(flat, ((0, 0), (0, 1))), faces), jobs=1)
    assert result.verification.overlap == 0
    assert not result.verification.flipped.any()


def test_thin_rings_are_opened_where_the_page_pays_for_it() -> None:
    """No chord crosses a ring, whose hole fills the page with nothing."""
    ring = shapes.annulus(60, along=1, inner=0.9)
    corners, sides = shapes.cube(1)
    shape = shapes.join(ring, (0.1 * corners, sides))
    whole, cut = (circparam.unwrap(shape, resolution=512, pack_splits=k) for k in (0, "auto"))
    assert whole.measures["pack"] < 0.2
    assert unwrapped.cost(cut) < unwrapped.cost(whole) - 2
    assert not cut.verification.flipped.any()
    assert cut.verification.overlap == 0


def test_no_part_is_above_the_bound() -> None:
    """Two fifths of the strip are drawn to 1.6 times their length: the whole is below the bound, that part
    alone is not."""
    before = roll()
    corners = before.corners.copy()
    corners[..., 0] += 0.6 * np.maximum(corners[..., 0] - 60, 0)
    drawn = Atlas(before.surface, before.cut, corners)
    part = before.part(before.corners[..., 0].min(1) >= 60)
    stretched = Atlas(part.surface, part.cut, drawn.corners[before.corners[..., 0].min(1) >= 60])
    assert chart_distortion(*drawn.open()).max() < 1.08 < chart_distortion(*stretched.open()).max()
    after = filled(drawn, bound=1.08).atlas
    cut_mesh, uv = after.open()
    assert cut_mesh.n_charts >= 2
    assert chart_distortion(cut_mesh, uv).max() <= 1.08
    assert fallback.faults(cut_mesh, uv).max() == fallback.SOUND
