"""Distortion, flips, charts and seams of known scenes."""

import re
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import InputError
from circparam.formats.io import read
from circparam.render.figures import as_figures, scene_figures
from circparam.render.scene import make_scene, with_instances
from circparam.render.show import scene_of, verified_set, view_document, view_figures
from circparam.render.views import draw_plan
from tests.support import shapes
from tests.support.command_line import obj
from tests.support.pairs import blob
from tests.support.scenes import IN_SPACE, QUAD, SQUARE, cube


def test_distortion_of_known_maps():
    """An isometry at any scale has 1; squeezing one axis by s gives (s² + s⁻² + 2) / 4, scaled best."""
    for scale in (1.0, 0.01, 30.0):
        scene = make_scene(IN_SPACE, QUAD, SQUARE * scale, QUAD)
        assert np.allclose(scene.distortion, 1.0)
        assert scene.scale == pytest.approx(scale)
    compacted = make_scene(IN_SPACE, QUAD, SQUARE * [1.0, 0.25], QUAD)
    assert np.allclose(compacted.distortion, (2.0**2 + 2.0**-2) * 2 / 4)


def test_a_face_without_shape_does_not_set_the_scale_of_all():
    """A sliver of no width in space that has an area in uv."""
    points, faces = shapes.grid(5, 5)
    sliver = np.array([[2, 0, 0], [3, 0, 0], [2.5, 1e-16, 0]])
    faces = np.concatenate([faces, [[25, 26, 27]]])
    uv = np.concatenate([points[:, :2], [[2, 0], [3, 0], [2.5, 1]]])
    scene = make_scene(np.concatenate([points, sliver]), faces, uv, faces)
    assert np.allclose(scene.distortion[:-1], 1.0)
    assert np.isinf(scene.distortion[-1])


def test_flips_are_against_the_chart():
    folded = SQUARE.copy()
    folded[3] = [0.9, 0.2]  # the second face turns over, and is the smaller one
    scene = make_scene(IN_SPACE, QUAD, folded, QUAD)
    assert scene.flipped.tolist() == [False, True]
    mirrored = make_scene(IN_SPACE, QUAD, SQUARE * [-1.0, 1.0], QUAD)
    assert not mirrored.flipped.any()


def test_degenerate_and_duplicate_faces_are_no_flips():
    faces = np.concatenate([QUAD, [[0, 2, 2]], [[2, 1, 0]]])  # a face without area, a turned twin
    assert not make_scene(IN_SPACE, faces, SQUARE, faces).flipped.any()
    turned = np.array(
        [[0, 1, 2], [0, 3, 2]]
    )  # the file winds one against the other: the uv do not fold
    assert not make_scene(IN_SPACE, turned, SQUARE, turned).flipped.any()


def test_charts_and_seams_of_the_cube():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv, uv_faces)
    assert scene.n_charts == 6
    assert len(scene.seams) == 24  # four sides of each chart
    assert not scene.outside
    assert not scene.inside_out
    assert make_scene(points, faces[:, ::-1], uv, uv_faces[:, ::-1]).inside_out


@pytest.mark.parametrize("place", [(0, 0, 0), (9, -5, 2), (-70, 30, 500)])
def test_closed_surfaces_are_inside_out_wherever_they_lie(place: tuple[int, int, int]):
    ball = blob(1, 3)
    uv, points = np.zeros((len(ball.points), 2)), ball.points + np.array(place)
    assert not make_scene(points, ball.faces, uv, ball.faces).inside_out
    assert make_scene(points, ball.faces[:, ::-1], uv, ball.faces).inside_out


def test_repeated_vertices_are_no_seams():
    """What glTF does at sharp edges: the same position and uv under two numbers."""
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    index = np.array([0, 1, 2, 0, 2, 3])
    scene = make_scene(IN_SPACE[index], faces, SQUARE[index], faces)
    assert scene.n_charts == 1
    assert len(scene.seams) == 4  # the sides of the square, not its diagonal


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
    with pytest.raises(InputError, match=message):
        make_scene(IN_SPACE, QUAD, uv, uv_faces)


def test_what_is_shown_again_is_drawn_and_not_counted():
    """A copy moved aside, and one that is mirrored: seen on the surface, once in layout and figures."""
    scene = make_scene(*cube())
    move, mirror = np.eye(4), np.diag([-1.0, 1, 1, 1])
    move[:3, 3] = [5, 0, 0]
    mirror[:3, 3] = [-5, 0, 0]
    fid = np.arange(6)
    shown = with_instances(scene, [(fid, move), (fid, mirror)])
    assert len(shown.faces) == 24
    assert shown.once is scene
    assert shown.n_charts == scene.n_charts
    assert shown.points[shown.faces].max((0, 1))[0] == 6
    assert shown.points[shown.faces].min((0, 1))[0] == -6
    assert shown.bounds == scene.bounds
    np.testing.assert_array_equal(shown.distortion[12:18], scene.distortion[fid])
    np.testing.assert_array_equal(shown.corner_uv[12:18], scene.corner_uv[fid])
    np.testing.assert_allclose(
        shown.normals[12:18], scene.normals[fid]
    )  # moved, not turned inside out
    np.testing.assert_allclose(shown.normals[18:], scene.normals[fid] * [-1, 1, 1])
    corners = (scene.points * [-1, 1, 1] - [5, 0, 0])[scene.faces[fid]]
    there = np.concatenate([corners, scene.corner_uv[fid]], 2).reshape(-1, 5)
    again = np.concatenate([shown.points[shown.faces[18:]], shown.corner_uv[18:]], 2).reshape(-1, 5)
    np.testing.assert_allclose(again[np.lexsort(again.T)], there[np.lexsort(there.T)])
    half = np.isin(scene.seams // 3, fid).sum()
    assert len(shown.seams) >= len(scene.seams) + 2 * half
    assert scene_figures(shown) == scene_figures(scene)
    np.testing.assert_array_equal(draw_plan(shown, 60).image, draw_plan(scene, 60).image)
    assert with_instances(scene, []) is scene


@pytest.mark.parametrize("shape", [shapes.moebius(), shapes.klein()])
def test_a_picture_shows_the_flips_that_reports_count(shape: shapes.Shape):
    """Faces wound against their neighbours are no flips, on one-sided surfaces either."""
    p, f = shape
    result = circparam.unwrap((p, f), effort=0.01)
    assert result.measures["flips"] == 0
    assert not make_scene(p, f, result.uv, result.uv_faces).flipped.any()


def test_pictures_tell_the_figures_of_the_reports(tmp_path: Path):
    """One mesh through unwrap, check and view: the same seam length, distortion and packed share."""
    p, f = shapes.cube(3)
    path = obj(tmp_path / "soup.obj", (p[f].reshape(-1, 3), np.arange(f.size).reshape(-1, 3)))
    result = circparam.unwrap(path, tmp_path / "out.obj", effort=0.01)
    document = read(tmp_path / "out.obj")
    uvmap = document.uv()
    told = dict(view_figures(verified_set(document, 0), scene_of(document, uvmap)))
    assert told == dict(as_figures(result.measures))
    assert result.measures["seam_length"] > 0


def test_the_head_of_a_page_and_its_table_count_the_same_charts(tmp_path: Path):
    """Two squares that meet in a corner, one face squeezed to nothing and one without uv: two charts."""
    path = tmp_path / "two.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 1 0\nv 2 2 0\nv 1 2 0\nv 5 5 0\nv 6 5 0\nv 5 6 0\n"
        "vt 0 0\nvt .4 0\nvt .4 .4\nvt 0 .4\nvt .8 .4\nvt .8 .8\nvt .4 .8\n"
        "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 3/3 5/5 6/6\nf 3/3 6/6 7/6\nf 8 9 10\n"
    )
    out = tmp_path / "page.html"
    view_document(read(path), out)
    text = out.read_text()
    assert "5 faces · 2 charts" in text
    assert "<th scope=row>charts</th><td>2</td>" in text
    assert not re.search(r"\de\+\d", text.partition("<table")[2].partition("</table>")[0])
    assert "infinite" in text


def test_figures_are_ordered_and_rounded():
    out = as_figures(
        {"own": 12.0, "flips": 0, "charts": 1234, "distortion": 1.04321987, "pack": 0.5}
    )
    assert out == [
        ("charts", "1,234"),
        ("distortion (1 is perfect)", "1.0432"),
        ("flips", "0"),
        ("packed", "50.0 %"),
        ("own", "12"),
    ]
    assert as_figures({"missing": 0, "gap_texels": None, "x": float("inf")}) == [("x", "infinite")]
