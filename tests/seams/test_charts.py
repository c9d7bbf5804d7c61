"""The atlas: charts that are disks under the bound, none overlapping itself, on shapes with known answers."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam import samples
from circparam.core.graph import matching
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.formats.io import read
from circparam.geometry.distortion import best_chart_scales, measure
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.surface import Surface
from circparam.seams import SEAMS
from circparam.seams import charts as module
from circparam.seams.multires.decimate import decimate
from circparam.seams.multires.transfer_seams import _Router
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation import grow
from circparam.seams.segmentation.decide import ROUGH
from circparam.seams.segmentation.enforce import enforce
from circparam.seams.segmentation.layout import judge, lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.paths import Bands, chains_of, route
from circparam.seams.segmentation.small import absorb
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.formats_tools import corpus_files


def surface_of(shape) -> Surface:
    return repair(Mesh(*shape))[0]


def atlas_of(shape, **options) -> tuple[Surface, Atlas]:
    """The charts of a shape, checked for everything that is promised of them."""
    surface = surface_of(shape)
    wanted = SeamOptions(**options)
    seams = SEAMS["charts"].function(surface, wanted, Monitor())
    atlas = Atlas(surface, seams.cut, seams.uv)
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    # one uv a vertex of the cut mesh: the corners agree wherever there is no seam
    assert np.array_equal(uv[cut_mesh.faces], seams.uv)
    assert not not_disks(cut_mesh).any()
    assert len(cut_mesh.chart) == len(surface.faces)
    assert (signs(uv, cut_mesh.faces) > 0).all()
    found = overlaps(cut_mesh.faces, uv, cut_mesh.chart, cut_mesh.edges)
    assert not found.self_overlapping.any()
    if wanted.max_charts is None:
        scaled = uv * best_chart_scales(cut_mesh, uv)[cut_mesh.vertex_chart][:, None]
        assert measure(cut_mesh, scaled).sd_max_chart <= wanted.max_distortion
    return surface, atlas


def test_unions_laid_out_in_two_halves_are_those_laid_out_at_once(monkeypatch) -> None:
    surface = surface_of(shapes.icosphere(3))
    start = Atlas(surface, np.zeros(len(surface.edges), bool))
    grow.first_charts(start, grow.dual_graph(surface), 40)
    lay_out_fresh(start, None, ROUGH)
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


def test_a_flat_sheet_stays_in_one_piece_without_a_seam() -> None:
    _, atlas = atlas_of(shapes.delaunay_square(400))
    assert not atlas.cut.any()


def test_a_cube_comes_apart_into_one_net() -> None:
    """A net of the cube is one chart without distortion: at D = 1.0001 nothing else is as good."""
    surface, atlas = atlas_of(shapes.cube(3), max_distortion=1.0001)
    assert atlas.charts()[0] == 1
    edge = np.sqrt(surface.areas.sum() / 6)
    # every net of the cube cuts 7 of its 12 edges
    assert surface.edge_lengths[atlas.cut].sum() == pytest.approx(7 * edge, rel=0.15)


def test_a_closed_cylinder_comes_apart_into_wall_and_caps() -> None:
    _, atlas = atlas_of(shapes.cylinder(32, 10, caps=True), max_distortion=1.001)
    assert atlas.charts()[0] <= 3


@pytest.mark.parametrize(
    ("shape", "most"),
    [
        (shapes.icosphere(3), 3),
        (shapes.torus(40, 20), 2),
        (shapes.double_torus(), 4),
        (shapes.annulus(), 1),
        (shapes.hemisphere(10), 2),
    ],
    ids=["sphere", "torus", "double torus", "annulus", "hemisphere"],
)
def test_round_shapes_need_few_charts(shape, most: int) -> None:
    _, atlas = atlas_of(shape)
    assert atlas.charts()[0] <= most


def least(shape) -> tuple[Atlas, float]:
    """A surface without seams, laid out with the least symmetric Dirichlet energy, and that energy."""
    surface = surface_of(shape)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    fine = RelaxOptions(tolerance=1e-10, max_iterations=200)
    return atlas, float(lay_out_fresh(atlas, None, fine).energy[0])


@pytest.mark.parametrize("share", [0.995, 1.005])
@pytest.mark.parametrize("shape", [shapes.hemisphere(8), shapes.bumped_disk(300)])
def test_the_bound_of_charts_is_kept_to_half_a_percent_of_its_excess(shape, share: float) -> None:
    """What is above it by that little even at its best is cut, what is below stays whole."""
    _, energy = least(shape)
    assert energy > 1.02
    _, atlas = atlas_of(shape, max_distortion=1 + (energy - 1) * share)
    assert atlas.cut.any() == (share < 1)


@pytest.mark.parametrize("share", [0.995, 1.005])
@pytest.mark.parametrize("shape", [shapes.hemisphere(8), shapes.bumped_disk(300)])
def test_enforcing_holds_the_bound_to_half_a_percent_of_its_excess(shape, share: float) -> None:
    atlas, energy = least(shape)
    cut_mesh = atlas.cut_mesh()
    laid = judge(cut_mesh, atlas.gather(cut_mesh))
    bound = 1 + (energy - 1) * share
    graph = grow.dual_graph(atlas.surface)
    enforce(atlas, graph, laid, bound, module.FINAL, Monitor())
    assert atlas.cut.any() == (share < 1)
    cut_mesh = atlas.cut_mesh()
    assert judge(cut_mesh, atlas.gather(cut_mesh)).energy.max() <= bound


def test_a_lower_bound_gives_more_seam_and_less_distortion() -> None:
    shape = shapes.icosphere(3)
    lengths = [atlas_of(shape, max_distortion=d)[1].seam_length for d in (1.01, 1.2)]
    assert lengths[0] > lengths[1]


def test_max_charts_is_kept_where_the_bound_is_not() -> None:
    _, atlas = atlas_of(shapes.cylinder(24, 8, caps=True), max_distortion=1.001, max_charts=1)
    assert atlas.charts()[0] == 1


def test_every_component_gets_charts_of_its_own() -> None:
    shape = shapes.row_of(shapes.cube(2), 5)
    surface, atlas = atlas_of(shape)
    n, chart = atlas.charts()
    assert n == 5
    x = surface.points[surface.faces].mean(1)[:, 0]
    for k in range(5):
        assert np.ptp(x[chart == k]) <= np.ptp(x) / 5


@pytest.mark.parametrize(
    "shape",
    [shapes.triangle(), shapes.fins(), shapes.moebius(), shapes.klein(), shapes.pinched()],
    ids=["triangle", "fins", "moebius", "klein", "pinched"],
)
def test_awkward_surfaces_end_in_a_valid_atlas(shape) -> None:
    atlas_of(shape)


def test_forced_seams_are_cut_and_forbidden_ones_are_not() -> None:
    shape = shapes.cube(3)
    surface = surface_of(shape)
    free = atlas_of(shape)[1]
    flat = surface.faces.ravel()
    ends = np.stack(
        [flat[surface.edges[:, 0]], surface.faces[:, [1, 2, 0]].ravel()[surface.edges[:, 0]]], 1
    )
    wanted = ends[~free.cut][:5]
    forbidden = ends[free.cut][:3]
    atlas = atlas_of(shape, cut=wanted, no_cut=forbidden)[1]
    index = {tuple(sorted(e)): k for k, e in enumerate(ends.tolist())}
    assert all(atlas.cut[index[tuple(sorted(e))]] for e in wanted.tolist())
    assert not any(atlas.cut[index[tuple(sorted(e))]] for e in forbidden.tolist())


def test_the_same_input_gives_the_same_bytes() -> None:
    a, b = (atlas_of(shapes.torus(24, 12))[1] for _ in range(2))
    assert np.array_equal(a.cut, b.cut)
    assert a.corners.tobytes() == b.corners.tobytes()


def test_the_proxy_path_finds_seams_as_short_as_the_direct_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shape = shapes.torus(70, 35)
    monkeypatch.setattr(module, "DIRECT_FACES", 10**9)
    direct = atlas_of(shape)[1]
    monkeypatch.setattr(module, "DIRECT_FACES", 0)
    monkeypatch.setattr("circparam.seams.multires.decimate.PROXY_FACES", 2500)
    proxy = atlas_of(shape)[1]
    assert proxy.seam_length == pytest.approx(direct.seam_length, rel=0.15, abs=0.05)
    assert abs(proxy.charts()[0] - direct.charts()[0]) <= 1


def test_the_proxy_keeps_the_genus_and_maps_every_vertex() -> None:
    surface = surface_of(shapes.torus(60, 30))
    proxy = decimate(surface, 600)
    none = np.zeros(len(proxy.surface.edges), bool)
    assert proxy.surface.cut_mesh(none).euler().tolist() == [0]
    assert len(proxy.surface.faces) < 700
    assert proxy.cell.min() >= 0
    assert set(proxy.cell.tolist()) == set(range(len(proxy.surface.points)))


def test_a_vertex_where_a_carried_path_may_end_is_not_moved_again() -> None:
    """Chains that find no path are halved; both halves end at the middle, also when one is halved once more."""
    surface = surface_of(shapes.torus(60, 30))
    proxy = decimate(surface, 600)
    coarse = Atlas(proxy.surface, np.zeros(len(proxy.surface.edges), bool))
    grow.first_charts(coarse, grow.dual_graph(proxy.surface), 6)
    a, b = (ends[coarse.cut] for ends in coarse.ends)
    fine = Atlas(surface, np.zeros(len(surface.edges), bool))
    nowhere = np.zeros(len(proxy.surface.points), bool)
    chains = chains_of(a, b, len(nowhere), nowhere)
    flat, along = proxy.surface.faces.ravel(), proxy.surface.faces[:, [1, 2, 0]].ravel()
    router = _Router(fine, proxy, (flat, along), nowhere, chains)
    middle = np.unique(chains.vertex)
    router.stand_again(middle, middle)
    stand = router.stand[middle].copy()
    assert np.array_equal(proxy.cell[stand], middle)
    # paths now run through those vertices
    fine.cut = np.isin(fine.ends[0], stand) | np.isin(fine.ends[1], stand)
    router.stand_again(middle, middle)
    assert np.array_equal(router.stand[middle], stand)


@given(st.integers(0, 5000))
@settings(max_examples=60)
def test_matching_is_the_greedy_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(1, 12)), int(rng.integers(0, 30))
    left, right = rng.integers(0, n, count), rng.integers(0, n, count)
    score = np.round(rng.random(count), 1)
    used = np.zeros(n, bool)
    expected = []
    for k in sorted(range(count), key=lambda k: (-score[k], k)):
        if not used[left[k]] and not used[right[k]]:
            used[left[k]] = used[right[k]] = True
            expected.append(k)
    assert matching(score, left, right, n).tolist() == sorted(expected)


def test_chains_end_at_junctions_and_closed_ones_are_halved() -> None:
    # a path 0-1-2-3, a closed loop 4-5-6-7, and a junction at 2 with a branch to 8
    a = np.array([0, 1, 2, 4, 5, 6, 7, 2])
    b = np.array([1, 2, 3, 5, 6, 7, 4, 8])
    chains = chains_of(a, b, 9, np.zeros(9, bool))
    ends = sorted(
        tuple(sorted(e)) for e in zip(chains.start.tolist(), chains.end.tolist(), strict=True)
    )
    assert ends == [(0, 2), (2, 3), (2, 8), (4, 6), (4, 6)]
    assert chains.size.sum() == len(a)
    assert sorted(chains.vertex.tolist()) == [1, 5, 7]


def test_routes_are_shortest_inside_their_bands_and_never_cross() -> None:
    """Two chains on a grid, side by side: each keeps to its own columns although the other's are shorter."""
    width, height = 6, 8
    index = np.arange(width * height).reshape(height, width)
    a = np.r_[index[:, :-1].ravel(), index[:-1].ravel()]
    b = np.r_[index[:, 1:].ravel(), index[1:].ravel()]
    owner = np.where(np.arange(width) < 3, 0, 1) * np.ones((height, 1), int)
    value = np.arange(height)[:, None] * np.ones(width)
    start, end = index[0, [1, 4]], index[-1, [1, 4]]
    owner = owner.ravel().copy()
    owner[np.r_[start, end]] = -1
    bands = Bands((a, b), np.ones(len(a)), owner, value.ravel())
    found = route(bands, start, end, np.full(2, height - 1))
    assert len(found.failed) == 0
    assert np.bincount(found.chain).tolist() == [height - 1, height - 1]
    for k in range(2):
        on = found.edges[found.chain == k]
        columns = np.r_[a[on], b[on]] % width
        assert ((columns < 3) == (k == 0)).all()


FEW = ("spot.obj", "teapot.obj", "CesiumMilkTruck.glb", "spider.obj", "reference_vcolor.ply")
WHOLE = bool(os.environ.get("CIRCPARAM_WHOLE_CORPUS"))


@pytest.mark.parametrize(
    "path",
    [p for p in corpus_files() if WHOLE or p.id in (*FEW, None)],  # type: ignore[attr-defined]
)
def test_real_meshes(path: Path) -> None:
    """All of them by ``make test-corpus``, five by ``make test``."""
    mesh = read(path).mesh
    atlas_of((mesh.points, mesh.faces))


@pytest.mark.parametrize("name", samples.names())
def test_samples(name: str) -> None:
    mesh = read(samples.path(name)).mesh
    atlas_of((mesh.points, mesh.faces))


def test_seeds_spread_over_components_in_few_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many components share the searches; one component takes its farthest cell each time."""
    searches = []
    plain = grow.distances

    def counted(*given: object) -> object:
        searches.append(1)
        return plain(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(grow, "distances", counted)
    tail = np.arange(400)[np.arange(400) % 4 != 3]  # 100 paths of four cells
    region = grow.grow(400, tail, tail + 1, np.ones(len(tail)), 200, 0)
    assert len(searches) <= 3
    assert (np.array([len(np.unique(r)) for r in region.reshape(100, 4)]) == 2).all()
    line = np.arange(8)
    region = grow.grow(9, line, line + 1, np.ones(8), 3, 0)
    assert len(np.unique(region)) == 3
    assert len(np.unique(region[[0, 4, 8]])) == 3


def straddled() -> Atlas:
    """A sphere in two charts and a third, of a few faces, across the seam between them."""
    surface = surface_of(shapes.icosphere(3))
    middle = surface.points[surface.faces].mean(1)
    half = (middle[:, 2] > 0).astype(np.int64)
    half[np.linalg.norm(middle - [1.0, 0, 0], axis=1) < 0.25] = 2
    e = surface.edges // 3
    atlas = Atlas(surface, half[e[:, 0]] != half[e[:, 1]])
    assert atlas.charts()[0] == 3
    lay_out_fresh(atlas, None, ROUGH)
    return atlas


def test_small_charts_join_their_neighbours_face_by_face() -> None:
    atlas = straddled()
    few = int(np.bincount(atlas.charts()[1]).min())
    assert absorb(atlas, MergeOptions(1.6), few, Monitor()) == 0
    assert atlas.charts()[0] == 3, "as large as asked already"
    # the two halves alone would close to a sphere: the bound keeps them apart
    assert absorb(atlas, MergeOptions(1.6), few + 1, Monitor()) == 0
    n, chart = atlas.charts()
    assert np.bincount(chart).min() > few
    cut_mesh = atlas.cut_mesh()
    laid = judge(cut_mesh, atlas.gather(cut_mesh))
    assert n == 2
    assert not laid.bad(1.6).any()


def test_small_charts_that_nobody_takes_stay_as_they_were() -> None:
    atlas = straddled()
    before = atlas.cut.copy()
    few = int(np.bincount(atlas.charts()[1]).min())
    assert absorb(atlas, MergeOptions(1.0001), few + 1, Monitor()) == 1
    assert np.array_equal(atlas.cut, before)


def test_min_chart_faces_is_kept_or_the_notes_count_what_is_below() -> None:
    surface = surface_of(shapes.cylinder(24, 8, caps=True))
    for least in (1, 40):
        wanted = SeamOptions(max_distortion=1.02, min_chart_faces=least)
        seams = SEAMS["charts"].function(surface, wanted, Monitor())
        size = np.bincount(Atlas(surface, seams.cut).charts()[1])
        below = int((size < least).sum())
        assert bool(below) == bool(seams.notes)
        assert all(note.startswith(f"{below} charts stay below {least}") for note in seams.notes)
