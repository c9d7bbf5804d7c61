"""Which sides are shown and what is up; the surface and the layout as pictures, pixel by pixel."""

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.geometry.raster import rasterise
from circparam.render.camera import best_directions, look_from, up_vector
from circparam.render.colours import line_weight
from circparam.render.figures import PictureOptions
from circparam.render.picture import draw_figure
from circparam.render.scene import make_scene
from circparam.render.texture import bilinear
from circparam.render.views import (
    checker_colours,
    draw_lines,
    draw_plan,
    layout_line_weight,
    paint,
    see,
    shrink,
)
from tests.support.scenes import IN_SPACE, QUAD, SQUARE, bowl, cube, flat_quad, squares
from tests.support.shapes import icosphere


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


def test_faces_without_uv_are_grey():
    scene = make_scene(IN_SPACE, QUAD, SQUARE, np.array([[0, 1, 2], [-1, -1, -1]]))
    assert scene.chart.tolist() == [0, -1]
    camera = look_from(scene, np.array([0.0, 0, 1]), margin=1.0)
    view = see(scene, camera, 16, 16, 1)
    colours = checker_colours(scene, view, 4)
    assert np.allclose(np.ptp(colours[view.face == 1], axis=1), 0, atol=0.15)
    image = draw_figure(scene, PictureOptions(samples=1))
    assert image.size == (1600, 1010)


def test_the_part_of_a_layout_that_overlaps():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv, uv_faces)
    plan = draw_plan(scene, 256)
    assert plan.overlap == 0
    half = np.concatenate([uv[:12], uv[:12]])  # the second half lies on the first
    plan = draw_plan(make_scene(points, faces, half, uv_faces), 256)
    assert plan.overlap == pytest.approx(1.0, abs=0.01)
    nothing = draw_plan(make_scene(points, faces, 0 * uv, uv_faces), 16)
    assert nothing.overlap == 0


def test_a_face_that_is_there_twice_is_no_overlap():
    """The other side of a sheet takes the place of the first: reports count it once, and so do pictures."""
    points, faces, uv, uv_faces = cube()
    both = np.concatenate([faces, faces[:, ::-1]])
    scene = make_scene(points, both, uv, np.concatenate([uv_faces, uv_faces[:, ::-1]]))
    once = make_scene(points, faces, uv, uv_faces)
    assert scene.seams.tolist() == once.seams.tolist()
    assert len(once.seams)
    plan = draw_plan(scene, 256)
    assert plan.overlap == 0


def test_uv_outside_the_unit_square_is_shown():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv * 3, uv_faces)
    assert scene.outside
    assert scene.bounds == pytest.approx((0, 0, 3, 3))
    corner = make_scene(points, faces, uv + np.array([5.0, 7.0]), uv_faces)
    u0, v0, u1, v1 = corner.bounds
    assert (u0, v0) == (0, 0)  # the unit square stays in the picture
    assert u1 >= 6
    assert v1 >= 8


def test_padding_band_has_its_width():
    scene = make_scene(IN_SPACE, QUAD, 0.5 * SQUARE + 0.25, QUAD)
    plain = draw_plan(scene, 400, 1).image
    padded = draw_plan(scene, 400, 1, padding=0.05).image
    changed = np.abs(plain - padded).max(2) > 0.01
    row = np.flatnonzero(changed[200])
    assert 17 <= (row < 100).sum() <= 20  # 20 pixels, less the border line that covers one or two
    assert row.min() in (80, 81)


def test_seams_are_painted_and_back_faces_differ():
    scene = make_scene(*cube())
    camera = look_from(scene, np.array([1.0, 1.0, 1.0]))
    view = see(scene, camera, 60, 60, 2)
    with_seams = paint(view, np.ones((len(view.pixel), 3)), np.zeros(3))
    without = paint(view, np.ones((len(view.pixel), 3)), np.zeros(3), line=0.0)
    assert with_seams[..., :3].sum() < without[..., :3].sum()
    assert (with_seams[..., 3] > 0).any()
    assert not view.back.any()


def test_a_ball_is_bright_towards_the_light_and_darker_all_the_way_round():
    points, faces = icosphere(3)
    ball = make_scene(points, faces, points[:, :2], faces)
    view = see(ball, look_from(ball, np.array([0.0, 0.0, 1.0])), 60, 60, 1)
    normal = np.einsum("pk,pkc->pc", view.bary, points[faces[view.face]])
    towards = normal @ [-0.40, 0.55, 0.73]
    bands = [view.light[(towards > low) & (towards < low + 0.2)].mean() for low in (0.8, 0.3, -0.3)]
    assert bands[0] > 1.2 * bands[1] > 1.4 * bands[2]


def test_one_line_has_its_width_and_none_draws_nothing():
    ends = np.array([[[3.5, 5.5]], [[16.5, 5.5]]])
    mask = draw_lines(*ends, (12, 20), 2.0)
    assert mask[:, 10].tolist() == [float(3 <= row <= 7) for row in range(12)]
    assert not draw_lines(*ends[:, :0], (12, 20), 2.0).any()


def test_lines_of_a_layout_are_thinner_the_more_there_are():
    """By their length in sides of the picture, wherever in the page the charts lie."""
    assert layout_line_weight(squares(4)) == 1
    for flip in (1.0, -1.0):
        assert layout_line_weight(squares(20, flip)) == pytest.approx(line_weight(4 * 20 * 0.8))


def test_colours_at_texels_between_them_and_beyond_the_edges(rng: np.random.Generator) -> None:
    image = rng.random((4, 6, 3))
    row, column = np.mgrid[0:4, 0:6].reshape(2, -1)
    uv = np.stack([(column + 0.5) / 6, 1 - (row + 0.5) / 4], 1)
    for repeated in (uv, np.add(uv, [1, -2])):
        np.testing.assert_allclose(bilinear(image, repeated), image.reshape(-1, 3), atol=1e-12)
    beside = (image + np.roll(image, -1, 1)) / 2
    np.testing.assert_allclose(bilinear(image, np.add(uv, [1 / 12, 0])), beside.reshape(-1, 3))
    above = (image + np.roll(image, 1, 0)) / 2
    np.testing.assert_allclose(bilinear(image, np.add(uv, [0, 1 / 8])), above.reshape(-1, 3))


def test_a_smaller_picture_has_the_means_of_its_blocks(rng: np.random.Generator) -> None:
    small = rng.random((5, 7, 3))
    large = small.repeat(3, 0).repeat(3, 1)
    large[::3] += 0.3  # the other two rows of each block make up for it
    large[1::3] -= 0.3
    np.testing.assert_allclose(shrink(large, 3), small)


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
