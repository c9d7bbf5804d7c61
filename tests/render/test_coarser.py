"""Fewer faces for a page: lines, charts, flips and what the layout covers stay; small scenes stay whole."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.arrays import edge_keys
from circparam.render.coarser import coarser
from circparam.render.figures import PageImages, PictureOptions
from circparam.render.html import page
from circparam.render.scene import Scene, make_scene, with_instances
from tests.support.shapes import grid


def sheet(n: int, seed: int = 0, holes: int = 0) -> Scene:
    """A bumpy sheet of n × n squares in two charts, with some faces left out."""
    rng = np.random.default_rng(seed)
    points, faces = grid(n, n)
    faces = np.delete(faces, rng.integers(0, len(faces), holes), axis=0)
    uv = points[:, :2].copy()
    points = np.c_[points[:, :2], 0.2 * np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1])]
    right = points[faces].mean(1)[:, 0] > 0.5
    both = np.concatenate([uv, uv + np.array([0.1, 0.0])])
    return make_scene(points, faces, both, faces + len(uv) * right[:, None])


def lines(scene: Scene) -> np.ndarray:
    """Keys of the edges in the layout that are seams."""
    corner = scene.uv_faces.ravel()
    h = scene.seams
    return np.sort(edge_keys(corner[h], corner[3 * (h // 3) + (h + 1) % 3], len(scene.uv)))


def test_few_faces_stay_as_they_are() -> None:
    scene = sheet(10)
    assert coarser(scene, 200) is scene


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(20, 60), st.integers(0, 40))
def test_what_is_left_is_of_the_scene_and_covers_it(seed: int, n: int, holes: int) -> None:
    scene = sheet(n, seed, holes)
    shown = coarser(scene, len(scene.faces) // 4)
    assert len(shown.faces) < 0.75 * len(scene.faces)
    assert (shown.chart == scene.chart[shown.source]).all()
    # every corner has a place and a uv that belong together
    place = np.empty(len(scene.uv), np.int64)
    place[scene.uv_faces] = scene.weld[scene.faces]
    assert (shown.weld[shown.faces] == place[shown.uv_faces]).all()
    assert (lines(shown) == lines(scene)).all()
    # signed: what is folded over counts against itself, so nothing is missing inside the lines
    assert np.isclose(shown.uv_areas.sum(), scene.uv_areas.sum(), rtol=1e-9)


def test_distortion_and_flips_are_those_of_the_faces_that_are_left() -> None:
    scene = sheet(40)
    f = int(np.argmin(np.abs(scene.uv[scene.uv_faces].mean(1) - [0.25, 0.5]).sum(1)))
    uv = scene.uv.copy()
    middle = uv[scene.uv_faces[f]].mean(0)
    uv[scene.uv_faces[f, 0]] = 2 * middle - uv[scene.uv_faces[f, 0]] + 1e-3
    scene = replace(scene, uv=uv)
    assert scene.flipped.any()
    shown = coarser(scene, 800)
    assert shown.flipped.sum() == scene.flipped.sum()
    assert (shown.distortion == scene.distortion[shown.source]).all()


def test_folds_leave_no_lines() -> None:
    """Long thin cells are crossed by many edges: faces turn over, and come to lie on each other."""
    scene = sheet(60, 5, holes=300)
    for most in (50, 200, 1000, 3000):
        assert (lines(coarser(scene, most)) == lines(scene)).all()


def test_slits_stay_open() -> None:
    """Neighbours in the layout that no edge joins are not drawn as one: here a slit as thin as can be."""
    scene = sheet(40)
    uv = scene.uv.copy()
    moved = scene.uv_faces[scene.chart == scene.chart[-1]].ravel()
    uv[moved] -= [0.1 - 1e-6, 0.0]
    shown = coarser(replace(scene, uv=uv), 800)
    sides = [np.unique(shown.uv_faces[shown.chart == k]) for k in (0, 1)]
    assert len(np.intersect1d(*sides)) == 0


def test_faces_without_uv_and_copies_are_drawn_too() -> None:
    scene = sheet(40)
    bare = np.zeros(len(scene.faces), bool)
    bare[:100] = True
    scene = make_scene(
        scene.points, scene.faces, scene.uv, np.where(bare[:, None], -1, scene.uv_faces)
    )
    matrix = np.eye(4)
    matrix[:3, 3] = 3.0, 0.0, 0.0
    double = with_instances(scene, [(np.arange(len(scene.faces)), matrix)])
    shown = coarser(double, 1600)
    assert shown.once is scene
    assert np.array_equal(shown.distortion, scene.distortion[shown.source], equal_nan=True)
    assert (~shown.mapped).sum() == 200
    left, right = (shown.points[shown.faces].mean(1)[:, 0] > 2.0) ^ np.array([[True], [False]])
    assert left.sum() == right.sum()
    assert len(np.unique(shown.points[shown.faces[left]][..., 0].max(1) > 2.0)) == 1


def test_a_page_says_that_it_draws_fewer(monkeypatch) -> None:
    scene = sheet(40)
    images = PageImages([(b"x", "image/png")], np.zeros(len(scene.faces), np.int64))
    options = PictureOptions(images=images)
    assert "drawn with" not in page(scene, options)
    monkeypatch.setattr("circparam.render.html.MOST_PAGE_FACES", 800)
    text = page(scene, options)
    shown = coarser(scene, 800)
    assert f"3,042 faces · 2 charts · drawn with {len(shown.faces):,} of the faces" in text
    assert f'"ranges":[{{"image":0,"first":0,"count":{len(shown.faces)}}}]' in text
