"""Pictures: known pixels of the rasteriser, what a scene knows, and figures that say what is there."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from circparam.errors import InputError, OptionError, OutputError
from circparam.geometry.raster import barycentric, fragments, rasterise
from circparam.mesh.mesh import Mesh, UVMap
from circparam.render import colours as col
from circparam.render.camera import best_directions, look_from, up_vector
from circparam.render.figures import PictureOptions, as_figures
from circparam.render.lines import draw_lines, shrink
from circparam.render.picture import draw_figure, save_preview
from circparam.render.scene import make_scene, row_labels
from circparam.render.svg import layout_svg, outlines
from circparam.render.views import checker_colours, coverage, draw_plan, paint, see

QUAD = np.array([[0, 1, 2], [0, 2, 3]])
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def cube():
    """A cube of side 2 about the origin; every side a chart of its own in a 3 × 2 grid."""
    points, faces, uv, uv_faces = [], [], [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            centre = np.zeros(3)
            centre[axis] = sign
            a = np.roll([0.0, 1.0, 0.0], axis)
            b = np.cross(centre, a)
            first, k = len(points), len(points) // 4
            for s, t in SQUARE:
                points.append(centre + (2 * s - 1) * a + (2 * t - 1) * b)
                uv.append([(k % 3 + 0.1 + 0.8 * s) / 3, (k // 3 + 0.1 + 0.8 * t) / 2])
            faces += (QUAD + first).tolist()
            uv_faces += (QUAD + first).tolist()
    return np.array(points), np.array(faces), np.array(uv), np.array(uv_faces)


def flat_quad():
    """The unit square in the plane z = 0 with itself as uv."""
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    return make_scene(points, QUAD, SQUARE, QUAD)


# the rasteriser --------------------------------------------------------------------------------------


def test_textured_quad_pixel_by_pixel():
    """A quad that fills the picture, checker of 4 × 4: every pixel has the colour of its cell."""
    scene = flat_quad()
    camera = look_from(scene, np.array([0.0, 0.0, 1.0]), margin=1.0)
    view = see(scene, camera, 16, 16, factor=1)
    colours = checker_colours(scene, view, 4)
    assert len(view.pixel) == 256
    light = (colours.mean(1) > colours.mean()).reshape(16, 16)
    x, y = np.meshgrid(np.arange(16) // 4, (15 - np.arange(16)) // 4)
    assert np.array_equal(light, (x + y) % 2 == 0)  # v grows upwards


def test_cube_known_pixels():
    """Straight on, a cube shows one side: a square of the right size, at the right depth."""
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv, uv_faces)
    camera = look_from(scene, np.array([0.0, 0.0, 1.0]), margin=2.0)
    xy, depth = camera.project(scene.points, 40, 40)
    face, z, layers = rasterise(xy[faces], 40, 40, depth[faces])
    seen = face >= 0
    expected = np.zeros((40, 40), bool)
    expected[10:30, 10:30] = True
    assert np.array_equal(seen, expected)
    normals = scene.normals[face[seen]]
    assert np.allclose(normals, [0, 0, 1])  # the nearer side wins, not the one behind
    assert np.allclose(z[seen], -1.0, atol=1e-6)
    assert (layers[seen] == 2).all()


@settings(max_examples=40)
@given(st.integers(0, 10_000))
def test_triangles_of_a_plane_never_leave_gaps_nor_meet(seed: int):
    """A triangulated convex region: every pixel centre inside belongs to exactly one face."""
    rng = np.random.default_rng(seed)
    n = 7
    gx, gy = np.meshgrid(np.arange(n), np.arange(n))
    p = np.stack([gx.ravel(), gy.ravel()], 1).astype(float)
    inner = (p > 0).all(1) & (p < n - 1).all(1)
    p[inner] += rng.uniform(-0.2, 0.2, (int(inner.sum()), 2))
    p = p * 9.5 + rng.uniform(0, 3, 2)
    i = np.arange(n * (n - 1)).reshape(n - 1, n)[:, :-1].ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + n + 1], 1), np.stack([i, i + n + 1, i + n], 1)])
    _, _, layers = rasterise(p[faces], 64, 64)
    c = np.arange(64) + 0.5
    inside = (c >= p[:, 0].min()) & (c < p[:, 0].max())
    inside_y = (c >= p[:, 1].min()) & (c < p[:, 1].max())
    assert np.array_equal(layers, (inside_y[:, None] & inside[None, :]).astype(int))


def test_chunks_change_nothing(monkeypatch: pytest.MonkeyPatch):
    rng = np.random.default_rng(1)
    xy = rng.uniform(-5, 45, (300, 3, 2))
    depth = rng.uniform(0, 1, (300, 3))
    whole = rasterise(xy, 40, 40, depth)
    monkeypatch.setattr("circparam.geometry.raster.CHUNK", 500)
    assert sum(1 for _ in fragments(xy, 40, 40)) > 10
    for a, b in zip(whole, rasterise(xy, 40, 40, depth), strict=True):
        assert np.array_equal(a, b)


def test_broken_triangles_cover_nothing():
    xy = np.array(
        [
            [[np.nan, 0], [5, 0], [0, 5]],
            [[1, 1], [1, 1], [1, 1.0]],
            [[0, 0], [9, 0], [4, 0]],
            [[-9, -9], [-5, -9], [-9, -5]],
        ]
    )
    face, z, layers = rasterise(xy, 8, 8, np.zeros((4, 3)))
    assert (face == -1).all()
    assert np.isinf(z).all()
    assert not layers.any()


def test_barycentric_gives_the_pixel_back():
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, 30, (20, 3, 2))
    for part in fragments(xy, 30, 30):
        b = barycentric(xy, part.face, part.pixel, 30)
        there = np.einsum("pk,pkc->pc", b, xy[part.face])
        centre = np.stack([part.pixel % 30 + 0.5, part.pixel // 30 + 0.5], 1)
        assert np.abs(there - centre).max() < 1e-6


def test_lines_are_hidden_by_what_is_nearer():
    z = np.full((10, 10), np.inf)
    z[:, 5:] = 1.0
    start, stop = np.array([[0.5, 5.5, 2.0]]), np.array([[9.5, 5.5, 2.0]])
    mask = draw_lines(start, stop, (10, 10), 0.5, z)
    assert mask[5, :5].all()
    assert not mask[:, 5:].any()
    assert draw_lines(start, stop, (10, 10), 0.5, z, bias=1.5)[5].all()


def test_shrink_averages():
    image = np.arange(16, dtype=float).reshape(4, 4, 1)
    assert np.array_equal(shrink(image, 2)[..., 0], [[2.5, 4.5], [10.5, 12.5]])


# the scene -------------------------------------------------------------------------------------------


def test_stretch_of_known_maps():
    """An isometry at any scale has stretch 1; squeezing one axis by s gives (s² + s⁻² + 2) / 4, scaled best."""
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    for scale in (1.0, 0.01, 30.0):
        scene = make_scene(points, QUAD, SQUARE * scale, QUAD)
        assert np.allclose(scene.stretch, 1.0)
        assert scene.scale == pytest.approx(scale)
    compacted = make_scene(points, QUAD, SQUARE * [1.0, 0.25], QUAD)
    assert np.allclose(compacted.stretch, (2.0**2 + 2.0**-2) * 2 / 4)


def test_flips_are_against_the_chart():
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    folded = SQUARE.copy()
    folded[3] = [0.9, 0.2]  # the second face turns over, and is the smaller one
    scene = make_scene(points, QUAD, folded, QUAD)
    assert scene.flipped.tolist() == [False, True]
    mirrored = make_scene(points, QUAD, SQUARE * [-1.0, 1.0], QUAD)
    assert not mirrored.flipped.any()


def test_degenerate_faces_and_twins_are_no_flips():
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    faces = np.concatenate([QUAD, [[0, 2, 2]], [[2, 1, 0]]])  # a face without area, a turned twin
    assert not make_scene(points, faces, SQUARE, faces).flipped.any()
    turned = np.array(
        [[0, 1, 2], [0, 3, 2]]
    )  # the file winds one against the other: the uv do not fold
    assert not make_scene(points, turned, SQUARE, turned).flipped.any()


def test_charts_and_seams_of_the_cube():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv, uv_faces)
    assert scene.n_charts == 6
    assert len(scene.seams) == 24  # four sides of each chart
    assert len(scene.inner_seams) == 12  # the edges of the cube, though no index is shared
    assert not scene.outside
    assert not scene.inside_out
    assert make_scene(points, faces[:, ::-1], uv, uv_faces[:, ::-1]).inside_out


def test_repeated_vertices_are_no_seams():
    """What glTF does at sharp edges: the same position and uv under two numbers."""
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    index = np.array([0, 1, 2, 0, 2, 3])
    scene = make_scene(points[index], faces, SQUARE[index], faces)
    assert scene.n_charts == 1
    assert len(scene.inner_seams) == 0


def test_charts_are_numbered_by_area():
    points, faces, uv, uv_faces = cube()
    uv[8:12] *= 1.3
    scene = make_scene(points, faces, uv, uv_faces)
    assert (scene.chart[4:6] == 0).all()


def test_row_labels_join_equal_rows_only():
    rows = np.array([[0.0, 1], [1, 0], [-0.0, 1], [1, 1e-300]])
    a = row_labels(rows)
    assert a[0] == a[2]
    assert len(set(a.tolist())) == 3


@pytest.mark.parametrize(
    ("uv", "uv_faces", "message"),
    [
        (np.zeros((0, 2)), np.full((2, 3), -1), "no face has uv"),
        (np.full((4, 2), np.nan), QUAD, "NaN"),
        (np.array([[0.0, 0], [1, 0], [1, np.inf], [0, 1]]), QUAD, "infinite"),
        (SQUARE, QUAD[:1], "shape"),
        (SQUARE[:3], QUAD, "there are only 3"),
    ],
)
def test_scenes_that_cannot_be(uv, uv_faces, message: str):
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    with pytest.raises(InputError, match=message):
        make_scene(points, QUAD, uv, uv_faces)


def test_faces_without_uv_are_grey():
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    scene = make_scene(points, QUAD, SQUARE, np.array([[0, 1, 2], [-1, -1, -1]]))
    assert scene.chart.tolist() == [0, -1]
    camera = look_from(scene, np.array([0.0, 0, 1]), margin=1.0)
    view = see(scene, camera, 16, 16, 1)
    colours = checker_colours(scene, view, 4)
    assert np.allclose(np.ptp(colours[view.face == 1], axis=1), 0, atol=0.15)
    image = draw_figure(scene, PictureOptions(samples=1))
    assert image.size == (1600, 1010)


# the layout ------------------------------------------------------------------------------------------


def test_layout_share_overlap_and_tiles():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv, uv_faces)
    share, double = coverage(scene)
    assert share == pytest.approx(0.64, abs=0.01)
    assert double == 0
    half = np.concatenate([uv[:12], uv[:12]])  # the second half lies on the first
    share, double = coverage(make_scene(points, faces, half, uv_faces))
    assert share == pytest.approx(0.32, abs=0.01)
    assert double == pytest.approx(1.0, abs=0.01)


def test_uv_outside_the_unit_square_is_shown():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv * 3, uv_faces)
    assert scene.outside
    assert scene.bounds == pytest.approx((0, 0, 3, 3))
    plan = draw_plan(scene, 90, 1)
    assert plan.share == pytest.approx(5.76 / 6, abs=0.02)  # six tiles hold the centre of a face
    corner = make_scene(points, faces, uv + np.array([5.0, 7.0]), uv_faces)
    u0, v0, u1, v1 = corner.bounds
    assert (u0, v0) == (0, 0)  # the unit square stays in the picture
    assert u1 >= 6
    assert v1 >= 8


def test_every_chart_has_its_colour_in_the_layout():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv, uv_faces)
    image = draw_plan(scene, 240, 1).image
    centres = uv.reshape(6, 4, 2).mean(1)
    seen = {
        tuple(np.round(image[int((1 - v) * 240), int(u * 240)], 3).tolist()) for u, v in centres
    }
    assert len(seen) == 6
    empty = image[120, 1]
    assert np.allclose(empty, col.rgb(col.PANEL), atol=0.01)


def test_padding_band_has_its_width():
    scene = make_scene(
        np.concatenate([SQUARE, np.zeros((4, 1))], 1), QUAD, 0.5 * SQUARE + 0.25, QUAD
    )
    plain = draw_plan(scene, 400, 1).image
    padded = draw_plan(scene, 400, 1, padding=0.05).image
    changed = np.abs(plain - padded).max(2) > 0.01
    row = np.flatnonzero(changed[200])
    assert 17 <= (row < 100).sum() <= 20  # 20 pixels, less the border line that covers one or two
    assert row.min() in (80, 81)


def test_outlines_close_and_keep_holes():
    """A ring of 8 quads: one chart with an outer and an inner loop."""
    a = np.linspace(0, 2 * np.pi, 9)[:-1]
    ring = np.concatenate(
        [np.stack([np.cos(a), np.sin(a)], 1), 0.5 * np.stack([np.cos(a), np.sin(a)], 1)]
    )
    i, j = np.arange(8), (np.arange(8) + 1) % 8
    faces = np.concatenate([np.stack([i, j, j + 8], 1), np.stack([i, j + 8, i + 8], 1)])
    uv = ring * 0.4 + 0.5
    scene = make_scene(np.concatenate([ring, np.zeros((16, 1))], 1), faces, uv, faces)
    loops = outlines(scene)
    assert [(chart, len(p)) for chart, p in loops] == [(0, 8), (0, 8)]
    for _, p in loops:
        step = np.linalg.norm(np.roll(p, -1, 0) - p, axis=1)
        assert step.max() < 0.4  # neighbours along the ring, no jumps


def test_svg_is_well_formed_and_has_one_path_a_chart():
    points, faces, uv, uv_faces = cube()
    text = layout_svg(make_scene(points, faces, uv, uv_faces), "a < b & c")
    root = ET.fromstring(text)
    name = "{http://www.w3.org/2000/svg}"
    assert root.find(f"{name}title").text == "a < b & c"
    charts = [p for p in root.iter(f"{name}path") if p.get("id", "").startswith("chart-")]
    assert len(charts) == 6
    x, y = (float(c) for c in re.match(r"M([\d.]+),([\d.]+)", charts[0].get("d")).groups())
    assert 0 <= x <= 1000
    assert 0 <= y <= 1000


# colours and views -----------------------------------------------------------------------------------


def test_stretch_map_falls_in_lightness_evenly():
    lightness = col.oklab(col.stretch_map(64))[:, 0]
    assert (np.diff(lightness) < 0).all()
    steps = np.linalg.norm(np.diff(col.oklab(col.stretch_map(64)), axis=0), axis=1)
    assert steps.max() < 1.5 * steps.min()


def test_oklab_there_and_back():
    c = np.random.default_rng(0).random((50, 3))
    assert np.allclose(col.from_oklab(col.oklab(c)), c, atol=1e-5)


def test_chart_colours_differ_for_the_colour_blind():
    """Deuteranopes and protanopes (Viénot 1999): the first eight charts stay apart."""
    rgb = col.chart_colours(np.arange(8))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    for rows in (
        [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
        [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
    ):
        seen = np.clip(linear @ np.array(rows).T, 0, 1)
        lab = col.oklab(
            np.where(seen <= 0.0031308, seen * 12.92, 1.055 * seen ** (1 / 2.4) - 0.055)
        )
        gap = np.linalg.norm(lab[:, None] - lab[None], axis=2) + np.eye(8)
        assert gap.min() > 0.07


def test_scale_end_covers_the_surface():
    assert col.stretch_top(np.array([1.0, 1.01, 1.02]), np.ones(3)) == 1.05
    assert col.stretch_top(np.array([1.0, np.inf, 4.0]), np.ones(3)) == 5.0
    assert col.stretch_top(np.full(2, np.nan), np.ones(2)) == 2.0


def bowl():
    """A bowl that opens upwards, wound upwards."""
    t, r = np.meshgrid(np.linspace(0, 2 * np.pi, 25)[:-1], np.linspace(0.02, 1, 8))
    points = np.stack([r * np.sin(t), 0.4 * r**2, r * np.cos(t)], 2).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(24), np.arange(7))
    i, k, j = i.ravel(), k.ravel(), ((i + 1) % 24).ravel()
    a, b, c, d = 24 * k + i, 24 * (k + 1) + i, 24 * (k + 1) + j, 24 * k + j
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def test_best_views_see_the_front_of_an_open_surface():
    points, faces = bowl()
    scene = make_scene(points, faces, points[:, [2, 0]], faces)
    assert scene.normals[:, 1].min() > 0
    directions = best_directions(scene, 2)
    assert directions[0] @ [0, 1, 0] > 0
    assert directions[0] @ directions[1] < 0.82
    turned = make_scene(points, faces[:, ::-1], points[:, [2, 0]], faces[:, ::-1])
    assert best_directions(turned, 1)[0] @ [0, 1, 0] < 0
    with pytest.raises(OptionError, match="up axis"):
        best_directions(scene, 2, up="w")


def test_up_is_where_the_feet_are_not():
    """A table stands on four feet: they span the outline along the axis that points up, and along no other."""
    points, faces, uv, uv_faces = cube()
    parts = [points * [1.0, 0.05, 0.7] + [0.0, 1.0, 0.0]]
    for x in (-0.7, 0.7):
        for z in (-0.5, 0.5):
            parts.append(points * [0.06, 0.5, 0.06] + [x, 0.5, z])
    points = np.concatenate(parts)
    faces, uv_faces = (np.concatenate([f + 24 * k for k in range(5)]) for f in (faces, uv_faces))
    uv = np.concatenate([uv] * 5)
    assert np.array_equal(up_vector(make_scene(points, faces, uv, uv_faces)), [0, 1, 0])
    lying = points[:, [2, 0, 1]]
    assert np.array_equal(up_vector(make_scene(lying, faces, uv, uv_faces)), [0, 0, 1])
    assert np.array_equal(up_vector(flat_quad()), [0, 1, 0])


def test_views_are_the_same_in_every_run():
    points, faces, uv, uv_faces = cube()
    a, b = (best_directions(make_scene(points, faces, uv, uv_faces)) for _ in range(2))
    assert np.array_equal(a, b)


def test_seams_are_painted_and_back_faces_differ():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv, uv_faces)
    camera = look_from(scene, np.array([1.0, 1.0, 1.0]))
    view = see(scene, camera, 60, 60, 2)
    with_seams = paint(view, np.ones((len(view.pixel), 3)), np.zeros(3))
    without = paint(view, np.ones((len(view.pixel), 3)), np.zeros(3), line=0.0)
    assert with_seams[..., :3].sum() < without[..., :3].sum()
    assert (with_seams[..., 3] > 0).any()
    assert not view.back.any()


# whole pictures --------------------------------------------------------------------------------------


def test_preview_of_every_kind(tmp_path: Path):
    points, faces, uv, uv_faces = cube()
    mesh, uvmap = Mesh(points, faces), UVMap(uv, uv_faces)
    measures = {"flips": 0, "distortion": 1.0432198, "charts": 6, "pack": 0.64, "gap_texels": None}
    for name in ("a.png", "a.svg", "a.html"):
        save_preview(tmp_path / name, mesh, uvmap, measures, PictureOptions(title="cube"))
        save_preview(
            tmp_path / f"again-{name}", mesh, uvmap, measures, PictureOptions(title="cube")
        )
        first, second = ((tmp_path / n).read_bytes() for n in (name, f"again-{name}"))
        assert first == second  # the same bytes every time
    image = np.asarray(Image.open(tmp_path / "a.png"))
    assert image.shape == (1010, 1600, 3)
    assert len(np.unique(image.astype(int) @ [1, 256, 65536])) > 100
    with pytest.raises(OutputError, match="png"):
        save_preview(tmp_path / "a.bmp", mesh, uvmap)
    with pytest.raises(OutputError, match="does not exist"):
        save_preview(tmp_path / "no" / "a.svg", mesh, uvmap)
    assert sorted(p.name for p in tmp_path.iterdir() if p.name.startswith(".")) == []


def test_figures_are_ordered_and_rounded():
    out = as_figures(
        {"own": 12.0, "flips": 0, "charts": 1234, "distortion": 1.04321987, "pack": 0.5}
    )
    assert out == [
        ("charts", "1,234"),
        ("stretch (1 is perfect)", "1.0432"),
        ("flipped faces", "0"),
        ("covered", "50.0 %"),
        ("own", "12"),
    ]
    assert as_figures({"missing": 0, "gap_texels": None, "x": float("inf")}) == [("x", "inf")]


def test_a_point_sized_and_a_flat_mesh_are_drawn():
    points = np.zeros((3, 3))
    scene = make_scene(points, np.array([[0, 1, 2]]), np.zeros((3, 2)), np.array([[0, 1, 2]]))
    assert draw_figure(scene, PictureOptions(samples=1)).size == (1600, 1010)
    huge = make_scene(
        1e12 * np.concatenate([SQUARE, np.zeros((4, 1))], 1), QUAD, SQUARE * 1e-9, QUAD
    )
    assert np.allclose(huge.stretch, 1)
    assert draw_figure(huge, PictureOptions(samples=1)).size == (1600, 1010)
