"""The atlas: charts that are disks under the bound, none overlapping itself, on shapes with known answers."""

import os
from pathlib import Path

import numpy as np
import pytest

from circparam import samples
from circparam.core.monitor import Monitor
from circparam.formats.io import read
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams import SEAMS, grown
from circparam.seams import charts as module
from circparam.seams.options import SeamOptions, Search
from circparam.seams.prices import edge_prices
from tests.support import shapes
from tests.support.atlases import assert_promises, charts_of, ends, relaxed, surface_of
from tests.support.corpus import MOST_SEARCHED_BYTES
from tests.support.formats_tools import corpus_files


def atlas_of(shape, **options) -> tuple[Surface, Atlas]:
    """The charts of a shape, checked for everything that is promised of them."""
    surface, wanted = surface_of(*shape), SeamOptions(**options)
    atlas = charts_of(surface, **options)
    assert_promises(atlas, wanted.max_distortion if wanted.max_charts is None else np.inf)
    return surface, atlas


def test_a_flat_sheet_stays_in_one_piece_without_a_seam() -> None:
    _, atlas = atlas_of(shapes.delaunay_square(400))
    assert not atlas.cut.any()


@pytest.mark.parametrize(("most", "charts"), [(None, 3), (1, 1)])
def test_a_closed_cylinder_comes_apart_into_wall_and_caps_or_fewer(most, charts: int) -> None:
    """A number of charts is kept where the bound is not."""
    shape = shapes.cylinder(24, 8, caps=True)
    assert atlas_of(shape, max_distortion=1.001, max_charts=most)[1].charts()[0] <= charts


@pytest.mark.parametrize("share", [0.995, 1.005])
@pytest.mark.parametrize("shape", [shapes.hemisphere(8), shapes.bumped_disk(300)])
def test_the_bound_of_charts_is_kept_to_half_a_percent_of_its_excess(shape, share: float) -> None:
    """What is above it by that little even at its best is cut, what is below stays whole."""
    _, energy = relaxed(shape)
    assert energy > 1.02
    _, atlas = atlas_of(shape, max_distortion=1 + (energy - 1) * share)
    assert atlas.cut.any() == (share < 1)


PEELED = 2 / 4 + 2 * np.sqrt(np.pi)  # two strips, as those of a tennis ball


@pytest.mark.parametrize(
    ("shape", "most"),
    [
        # a seam along the wall and one round each end, each cap none
        (shapes.rod(), 1.1 * ((6 + 4 * np.pi) / np.sqrt(12 * np.pi + 4 * np.pi) + 3 / 4)),
        (shapes.stone(2, 0.2), PEELED),
        (shapes.stone(3, 0.1), PEELED),
    ],
    ids=["rod", "coarse stone", "stone"],
)
@pytest.mark.parametrize("draft", [True, False])
def test_round_shapes_of_flats_cost_no_more_than_when_peeled(shape, most: float, draft) -> None:
    atlas = atlas_of(shape, search=Search(draft=draft))[1]
    assert atlas.seam_length + atlas.charts()[0] / 4 <= most


@pytest.mark.parametrize("dear", [True, False])
def test_grown_charts_take_the_place_of_dearer_ones(dear: bool) -> None:
    """Every facet as a chart costs more than charts that are grown, a single chart less."""
    surface = surface_of(*shapes.rod())
    prices = edge_prices(surface)
    atlas = Atlas(surface, ~prices.flat if dear else np.zeros_like(prices.flat), prices=prices)
    before, every = atlas.cut.copy(), np.ones(len(surface.faces), bool)
    grown_there = module.grown_where_cheaper(atlas, every, 1.05, SeamOptions(), Monitor())
    assert (grown_there == dear).all()
    if dear:
        assert_promises(atlas, 1.05)
    else:
        assert np.array_equal(atlas.cut, before)


@pytest.mark.parametrize(
    "shape", [shapes.cube(4), shapes.row_of(shapes.icosphere(1), 2)], ids=["cube", "two balls"]
)
def test_a_number_of_charts_never_leads_to_more(shape) -> None:
    """Nor, where the free atlas has no more, to any other atlas."""
    bound = {"max_distortion": 1.01}
    _, free = atlas_of(shape, **bound)
    count = free.charts()[0]
    for most in sorted({1, count - 1, count} - {0}):
        _, atlas = atlas_of(shape, max_charts=most, **bound)
        assert atlas.charts()[0] <= count
        if most >= count:
            assert np.array_equal(atlas.cut, free.cut)


def test_an_atlas_that_lies_on_itself_is_worth_less_than_one_of_more_charts() -> None:
    """Its charts would be split, and nobody knows into how many."""
    _, sound = atlas_of(shapes.cube(4))
    assert sound.charts()[0] >= 1
    surface = sound.surface
    flat = Atlas(surface, np.ones(len(surface.edges), bool), surface.rest_triangles)
    one = Atlas(surface, sound.cut, np.zeros_like(sound.corners))
    assert flat.charts()[0] > one.charts()[0]
    assert module.worth(flat, 1, 1.05) < module.worth(one, 1, 1.05)
    assert module.worth(sound, 1, 1.05) < module.worth(flat, 1, 1.05)


def needles(n: int, height: float) -> tuple[np.ndarray, np.ndarray]:
    """A dome over a grid whose lines lie a hundred times closer here than there."""
    p, f = shapes.grid(n, n)
    steps = np.random.default_rng(1).pareto(1.2, n + 1) + 0.02
    line = np.cumsum(steps) / steps.sum()
    x = np.interp(p[:, :2], np.linspace(0, 1, n + 1), line)
    return np.c_[x, height * ((x - 0.5) ** 2).sum(1)], f


def test_a_disk_that_needs_no_seam_gets_none_however_its_faces_are_made() -> None:
    surface, atlas = atlas_of(needles(60, 0.2))
    assert len(surface.faces) > grown.DIRECT_FACES
    assert not atlas.cut.any()


def test_forced_seams_are_cut_and_forbidden_ones_are_not() -> None:
    shape = shapes.cube(3)
    surface = surface_of(*shape)
    free = atlas_of(shape)[1]
    pairs = np.sort(ends(surface), 1)
    wanted, forbidden = pairs[~free.cut][:5], pairs[free.cut][:3]
    atlas = atlas_of(shape, cut=wanted, no_cut=forbidden)[1]
    cut = {tuple(pair) for pair in pairs[atlas.cut].tolist()}
    assert cut >= {tuple(pair) for pair in wanted.tolist()}
    assert not cut & {tuple(pair) for pair in forbidden.tolist()}


def test_the_proxy_path_finds_seams_as_short_as_the_direct_one() -> None:
    """The seams of a fine torus, decided on a proxy, are about those of a coarse one, decided on itself."""
    (small, direct), (large, proxy) = (atlas_of(shapes.torus(n, n // 2)) for n in (36, 90))
    assert len(small.faces) < grown.DIRECT_FACES < len(large.faces)
    assert proxy.seam_length <= 1.15 * direct.seam_length + 0.05
    assert abs(proxy.charts()[0] - direct.charts()[0]) <= 1


FEW = ("spot.obj", "teapot.obj", "CesiumMilkTruck.glb", "spider.obj", "reference_vcolor.ply")
WHOLE = bool(os.environ.get("CIRCPARAM_WHOLE_CORPUS"))


@pytest.mark.parametrize("path", [p for p in corpus_files() if WHOLE or p.id in (*FEW, None)])
def test_real_meshes(path: Path) -> None:
    """All of them by ``make test-corpus``, large ones as drafts; five by ``make test``."""
    mesh = read(path).mesh
    draft = path.stat().st_size > MOST_SEARCHED_BYTES
    atlas_of((mesh.points, mesh.faces), search=Search(draft=draft))


# the second of a pair; what the tutorial unwraps into a file with a gate, or a shape of this file
LIKE_OTHERS = {"creature-pose", "head-2", "cover-coarse", "knot", "bumped-disk"}


@pytest.mark.parametrize("name", [n for n in samples.names() if n not in LIKE_OTHERS])
def test_samples(name: str) -> None:
    mesh = read(samples.path(name)).mesh
    atlas_of((mesh.points, mesh.faces))


@pytest.mark.parametrize("most", [None, 1, 3])
def test_min_chart_faces_is_kept_or_one_note_counts_what_is_below(most: int | None) -> None:
    surface = surface_of(*shapes.cylinder(24, 8, caps=True))
    for least in (1, 40):
        wanted = SeamOptions(max_distortion=1.02, min_chart_faces=least, max_charts=most)
        seams = SEAMS["charts"].function(surface, wanted, Monitor())
        size = np.bincount(Atlas(surface, seams.cut).charts()[1])
        below = int((size < least).sum())
        assert len(seams.notes) == bool(below)
        assert all(note.startswith(f"{below} charts stay below {least}") for note in seams.notes)


def test_prices_of_seams_are_left_out_where_charts_need_the_time() -> None:
    surface = surface_of(*shapes.icosphere(2))
    for timeout, priced in ((None, True), (1000.0, True), (20.0, False)):
        monitor = Monitor(timeout=timeout)
        monitor.seconds["repair"] = 1.0
        SEAMS["charts"].function(surface, SeamOptions(), monitor)
        assert ("visibility" in monitor.seconds) is priced
