from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.monitor import Monitor
from circparam.errors import NoResultError, OptionError
from circparam.packing import pack
from circparam.packing.budget import Budget
from circparam.packing.check import PlacedCharts, faults
from circparam.packing.nest import compaction
from circparam.packing.options import Packed, PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.pack import finish
from circparam.packing.shelf import shelf_placement
from circparam.packing.skyline import skyline_placement

QUICK = 0.02  # effort: the guarantees hold after any amount of search


def blobs(n, seed, spread=0.8):
    """n star-shaped charts of mixed sizes: (faces, uv, chart)."""
    rng = np.random.default_rng(seed)
    faces, uv, chart, at = [], [], [], 0
    for c in range(n):
        k = int(rng.integers(5, 25))
        t = np.arange(k) * 2 * np.pi / k
        r = 1 + 0.5 * np.sin(rng.integers(1, 6) * t + rng.uniform(0, 6)) * rng.uniform(0.2, 1)
        p = np.stack([r * np.cos(t), rng.uniform(0.2, 1) * r * np.sin(t)], 1)
        a = rng.uniform(0, 6)
        p = p @ np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        p = np.r_[[[0, 0]], p] * np.exp(rng.normal(0, spread)) + rng.normal(0, 9, 2)
        i = np.arange(k)
        faces.append(np.stack([0 * i, 1 + i, 1 + (i + 1) % k], 1) + at)
        uv.append(p)
        chart.append(np.full(k, c))
        at += k + 1
    return np.concatenate(faces), np.concatenate(uv), np.concatenate(chart)


def shelf(faces, uv, chart, options):
    """Rows of boxes only, as ``pack`` would return them."""
    shapes = shapes_of(faces, uv, chart)
    placement = shelf_placement(shapes, options)
    packed, wrong = finish(shapes, placement, options)
    assert wrong is None
    return packed


def triangles(n, seed):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(n, 3, 2)) * np.exp(rng.normal(0, 0.5, (n, 1, 1)))
    d = np.linalg.det(p[:, 1:] - p[:, :1])
    p[d < 0] = p[d < 0][:, ::-1]
    return np.arange(3 * n).reshape(n, 3), p.reshape(-1, 2), np.arange(n)


def covered(faces, uv, chart, res):
    """Texel centres inside each chart, one triangle after the other with half-planes: (res, res) sets."""
    owner = np.full((res, res), -1)
    twice = 0
    for f, c in zip(faces, chart, strict=True):
        q = uv[f] * res
        low = np.maximum(np.floor(q.min(0)).astype(int) - 1, 0)
        high = np.minimum(np.ceil(q.max(0)).astype(int) + 1, res)
        y, x = np.mgrid[low[1] : high[1], low[0] : high[0]] + 0.5
        sign = np.sign(np.linalg.det(q[1:] - q[0]))
        inside = np.ones(x.shape, bool)
        for k in range(3):
            a, b = q[k], q[(k + 1) % 3]
            inside &= sign * ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) >= -1e-9
        part = owner[low[1] : high[1], low[0] : high[0]]
        twice += int(((part >= 0) & (part != c) & inside).sum())
        part[inside] = c
    return owner, twice


def gap_and_border(owner):
    """Least distance of covered centres of two charts by all pairs of rim texels, and border distance."""
    from scipy.spatial import cKDTree

    y, x = np.nonzero(owner >= 0)
    res = len(owner)
    border = min(y.min(), x.min(), res - 1 - y.max(), res - 1 - x.max())
    who = owner[y, x]
    trees = [cKDTree(np.stack([x, y], 1)[who == c]) for c in np.unique(who)]
    gap = np.inf
    for i, a in enumerate(trees):
        for b in trees[:i]:
            gap = min(gap, float(b.query(a.data, distance_upper_bound=20)[0].min()))
    return gap, int(border)


def two_squares(corners, side=8, page=64):
    """Layout of squares, a chart each, that cover side x side texel centres from the texels ``corners`` on."""
    square = np.array(
        [[0.25, 0.25], [side - 0.25, 0.25], [side - 0.25, side - 0.25], [0.25, side - 0.25]]
    )
    points = (np.array(corners)[:, None] + square) / page
    n = len(corners)
    return PlacedCharts(
        points[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 2), np.repeat(np.arange(n), 2),
        points.reshape(-1, 2), np.roll(points, -1, 1).reshape(-1, 2), np.repeat(np.arange(n), 4),
        np.zeros(n, int),
    )  # fmt: skip


@pytest.mark.parametrize("padding", [0, 1, 2, 4, 7])
@pytest.mark.parametrize("mirror", [False, True])
def test_the_gap_is_checked_to_the_texel(padding, mirror):
    """Centres of two charts are padding + 1 apart or more: as they should is let through, nearer is not."""
    options = PackOptions(resolution=64, padding=padding)
    seen = set()
    for dx in range(padding + 3):
        for dy in range(padding + 3):
            first, second = [20, 20], [27 + dx, 27 + dy]  # the nearest texels are (dx, dy) apart
            if mirror:
                first, second = [20, 27 + dy], [27 + dx, 20]
            if dx == dy == 0:
                continue
            wrong, share = faults(two_squares([first, second]), options)
            assert share[0] == 2 * 64 / 64**2
            assert (wrong is not None) == (dx**2 + dy**2 < (padding + 1) ** 2), (dx, dy, wrong)
            seen.add(wrong is not None)
    assert seen == ({False, True} if padding else {False})


@pytest.mark.parametrize("padding", [0, 1, 2, 4, 7])
def test_the_border_of_the_page_is_checked_to_the_texel(padding):
    options = PackOptions(resolution=64, padding=padding)
    last = 64 - 8 - padding
    for corner in ([padding, 30], [30, padding], [last, 30], [30, last]):
        assert faults(two_squares([corner]), options)[0] is None
        outward = np.sign(np.array(corner) - 30)
        wrong = faults(two_squares([corner + outward]), options)[0]
        assert wrong is not None
        assert ("border" if padding else "leaves the page") in wrong


def similarity_residual(before, after, chart_vertices):
    """Largest deviation from one scale, a turn and a move per chart, no mirror; and the scales found."""
    scales, worst = [], 0.0
    for v in chart_vertices:
        a = before[v] @ [1, 1j]
        b = after[v] @ [1, 1j]
        a, b = a - a.mean(), b - b.mean()
        z = np.vdot(a, b) / np.vdot(a, a)
        scales.append(abs(z))
        worst = max(worst, float(np.abs(z * a - b).max()))
    return worst, np.array(scales)


def vertices_of(faces, chart):
    return [np.unique(faces[chart == c]) for c in range(chart.max() + 1)]


def promise(faces, uv, chart, packed: Packed, options: PackOptions):
    """Everything that is promised of a packed layout, by means of this file only."""
    tile = np.zeros(len(uv), int)
    for c, v in enumerate(vertices_of(faces, chart)):
        tile[v] = packed.page[c]
    local = packed.uv - np.stack([tile, 0 * tile], 1)
    local = local.astype(np.float32).astype(float)
    assert local.min() >= 0
    assert local.max() <= 1
    for p in range(options.pages):
        on = packed.page[chart] == p
        owner, twice = covered(faces[on], local, chart[on], options.resolution)
        assert twice == 0
        assert packed.share[p] == pytest.approx((owner >= 0).mean(), abs=0.002)
        if (owner >= 0).any():
            gap, border = gap_and_border(owner)
            assert gap >= options.padding + 1
            assert border >= options.padding
    worst, scales = similarity_residual(uv, packed.uv, vertices_of(faces, chart))
    assert worst < 1e-9
    assert scales == pytest.approx(packed.scale)


@settings(max_examples=12)
@given(
    n=st.integers(1, 12),
    seed=st.integers(0, 10**6),
    padding=st.integers(0, 7),
    resolution=st.sampled_from([96, 160, 256]),
    rotate=st.sampled_from(["free", "90", "none"]),
)
def test_padding_border_and_overlap_on_random_charts(n, seed, padding, resolution, rotate):
    faces, uv, chart = blobs(n, seed)
    options = PackOptions(resolution, padding, rotate, effort=QUICK)
    promise(faces, uv, chart, pack(faces, uv, chart, options), options)


@pytest.mark.parametrize("packer", [pack, shelf])
def test_sixty_charts_keep_the_promise(packer):
    faces, uv, chart = blobs(60, 3)
    options = PackOptions(512, 4, effort=QUICK)
    promise(faces, uv, chart, packer(faces, uv, chart, options), options)


def test_nesting_beats_rows_of_boxes():
    faces, uv, chart = blobs(9, 5)
    options = PackOptions(512, effort=0.2)
    tight, rows = pack(faces, uv, chart, options), shelf(faces, uv, chart, options)
    assert tight.share[0] > 1.15 * rows.share[0]


def test_one_chart_is_turned_to_fill_the_page():
    """A square on its tip fills the page up to the border when turned by 45 degrees."""
    uv = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    packed = pack(faces, uv, np.zeros(2, int), PackOptions(256, 4))
    assert packed.share[0] == pytest.approx((248 / 256) ** 2, abs=1e-3)


@pytest.mark.parametrize("rotate", ["90", "none"])
def test_rotations_are_those_allowed(rotate):
    faces, uv, chart = blobs(7, 11)
    packed = pack(faces, uv, chart, PackOptions(256, 4, rotate, effort=QUICK))
    for v in vertices_of(faces, chart):
        a, b = (uv[v] - uv[v[0]]) @ [1, 1j], (packed.uv[v] - packed.uv[v[0]]) @ [1, 1j]
        angle = np.angle(np.vdot(a, b)) / (np.pi / 2)
        assert angle == pytest.approx(round(angle) if rotate == "90" else 0, abs=1e-9)


def test_two_thousand_single_triangles():
    faces, uv, chart = triangles(2000, 1)
    options = PackOptions(1024, 2)
    packed = pack(faces, uv, chart, options)
    owner, twice = covered(faces, packed.uv, chart, 1024)
    assert twice == 0
    assert packed.share[0] > 1.1 * shelf(faces, uv, chart, options).share[0]
    centres = np.argwhere(owner >= 0)
    who = owner[owner >= 0]
    from scipy.spatial import cKDTree

    pairs = cKDTree(centres).query_pairs(2.99, output_type="ndarray")
    assert (who[pairs[:, 0]] == who[pairs[:, 1]]).all()


def test_charts_smaller_than_a_texel_do_not_overlap():
    """Specks cover no texel centre; their boxes are still apart by a texel's diagonal."""
    faces, uv, chart = blobs(3, 2)
    small, small_uv, small_chart = triangles(40, 4)
    uv2 = np.r_[uv, small_uv * 1e-4]
    faces2 = np.r_[faces, small + len(uv)]
    chart2 = np.r_[chart, small_chart + 3]
    packed = pack(faces2, uv2, chart2, PackOptions(256, 2, effort=QUICK))
    box = np.array(
        [[packed.uv[v].min(0), packed.uv[v].max(0)] for v in vertices_of(faces2, chart2)]
    )
    box = box[3:] * 256
    apart = np.maximum(box[:, None, 0] - box[None, :, 1], box[None, :, 0] - box[:, None, 1]).max(2)
    assert apart[~np.eye(40, dtype=bool)].min() > 1


def test_density_sets_the_scale():
    faces, uv, chart = blobs(6, 8)
    packed = pack(faces, uv, chart, PackOptions(256, 2, texel_density=20.0, effort=QUICK, pages=4))
    assert packed.scale == pytest.approx(20 / 256)
    promise(
        faces, uv, chart, packed, PackOptions(256, 2, texel_density=20.0, effort=QUICK, pages=4)
    )


def test_sizes_are_kept_without_scale():
    faces, uv, chart = blobs(6, 8)
    uv = uv / 40
    packed = pack(faces, uv, chart, PackOptions(256, 2, scale=False, effort=QUICK))
    assert packed.scale == 1.0


@pytest.mark.parametrize("n", [10, 300])
def test_more_pages_hold_larger_charts(n):
    faces, uv, chart = blobs(n, 9, 0.3)
    one = pack(faces, uv, chart, PackOptions(256, 1, effort=QUICK))
    options = PackOptions(256, 1, pages=3, effort=0.2)
    three = pack(faces, uv, chart, options)
    assert three.scale > 1.3 * one.scale
    assert set(three.page) >= {0, 1}
    assert three.share.shape == (3,)
    if n == 10:
        promise(faces, uv, chart, three, options)


def test_density_that_cannot_fit_is_refused():
    faces, uv, chart = blobs(6, 8)
    with pytest.raises(OptionError, match="texel density 900"):
        pack(faces, uv, chart, PackOptions(256, texel_density=900, effort=QUICK))


@pytest.mark.parametrize(
    "values",
    [
        {"padding": -1},
        {"padding": 130, "resolution": 256},
        {"resolution": 0},
        {"rotate": "45"},
        {"pages": 0},
        {"texel_density": -2.0},
        {"texel_density": 3.0, "scale": False},
    ],
)
def test_options_out_of_range_are_refused(values):
    with pytest.raises(OptionError):
        PackOptions(**values)


def test_more_charts_than_places_are_refused():
    faces, uv, chart = triangles(500, 1)
    with pytest.raises(OptionError, match="500 charts do not fit"):
        pack(faces, uv, chart, PackOptions(64, 4))


def test_charts_without_area_are_kept_and_named():
    faces, uv, chart = blobs(3, 1)
    uv = np.r_[uv, [[0, 0], [1, 0], [2, 0]]]
    faces = np.r_[faces, [[len(uv) - 3, len(uv) - 2, len(uv) - 1]]]
    packed = pack(faces, uv, np.r_[chart, [3]], PackOptions(128, 2, effort=QUICK))
    assert "1 of 4 charts have no area" in packed.notes[0]
    line = packed.uv[-3:]
    assert np.ptp(line, axis=0).max() > 0


def test_nothing_to_pack_is_refused():
    with pytest.raises(NoResultError):
        pack(np.array([[0, 1, 2]]), np.zeros((3, 2)), np.zeros(1, int))


def test_charts_that_share_a_vertex_are_refused():
    uv = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    with pytest.raises(OptionError, match="shares a uv vertex"):
        pack(np.array([[0, 1, 2], [1, 3, 2]]), uv, np.array([0, 1]))


def test_inputs_are_untouched_and_mirrored_charts_stay_so():
    faces, uv, chart = blobs(4, 6)
    uv[:, 0] *= -1
    before = [x.copy() for x in (faces, uv, chart)]
    packed = pack(faces, uv, chart, PackOptions(128, 1, effort=QUICK))
    for x, y in zip(before, (faces, uv, chart), strict=True):
        assert np.array_equal(x, y)
    q = packed.uv[faces]
    assert (np.linalg.det(q[:, 1:] - q[:, :1]) < 0).all()


PROGRAM = """
import hashlib, sys
sys.path.insert(0, {folder!r})
from test_pack import blobs, pack, PackOptions
print(hashlib.sha256(pack(*blobs(12, 4), PackOptions(256, effort=0.05)).uv.tobytes()).hexdigest())
"""


def test_the_same_input_gives_the_same_bytes():
    from pathlib import Path

    folder = str(Path(__file__).parent)
    runs = [
        subprocess.run(
            [sys.executable, "-c", PROGRAM.format(folder=folder)],
            env={"PYTHONHASHSEED": seed, "OMP_NUM_THREADS": seed, "PATH": ""},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert runs[0] == runs[1]


def test_a_bundle_of_needles_makes_no_huge_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parallel needles within reach of each other touch everywhere: such a program is not solved."""
    n = 10
    uv = np.zeros((3 * n, 2))
    uv[1::3, 0] = 1.0
    uv[2::3] = [0.5, 1e-6]
    faces = np.arange(3 * n).reshape(n, 3)
    rows: list[int] = []
    solve = compaction.linprog

    def recorded(*args: object, **options: object) -> object:
        rows.append(options["A_ub"].shape[0])  # type: ignore[attr-defined]
        return solve(*args, **options)

    monkeypatch.setattr(compaction, "linprog", recorded)
    options = PackOptions(resolution=256, padding=2, effort=QUICK)
    pack(faces, uv, np.arange(n), options)
    most = max(rows)
    limit = most // 2
    rows.clear()
    monkeypatch.setattr(compaction, "MOST_ROWS", limit)
    packed = pack(faces, uv, np.arange(n), options)
    assert all(r <= limit for r in rows)
    assert np.isfinite(packed.uv).all()


@pytest.mark.parametrize("seed", range(2))
def test_squeezing_takes_back_steps_that_are_too_long(seed: int) -> None:
    """Steps many times as long as the charts are wide: a tip pushed through a neighbour would stay there."""
    n = 30
    rng = np.random.default_rng(seed)
    uv = np.zeros((3 * n, 2))
    turn = rng.random(n) * 2 * np.pi
    along = np.stack([np.cos(turn), np.sin(turn)], 1)
    uv[1::3] = along
    uv[2::3] = along / 2 + 0.02 * np.stack([-along[:, 1], along[:, 0]], 1)
    shapes = shapes_of(np.arange(3 * n).reshape(n, 3), uv, np.arange(n))
    options = PackOptions(resolution=1024, padding=4)
    start = skyline_placement(shapes, options, Monitor())
    assert start is not None
    after = compaction.compact(shapes, start, options, 12, Budget(1e9, lambda: False), 256.0)
    assert finish(shapes, after, options)[1] is None
    assert after.scale > 1.02 * start.scale
