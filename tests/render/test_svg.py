"""The layout as SVG."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from circparam.render.colours import FLIP
from circparam.render.figures import PictureOptions
from circparam.render.scene import make_scene
from circparam.render.svg import figure_svg, outlines
from circparam.render.views import checker_cells
from tests.support.scenes import cube, flat_quad
from tests.support.shapes import flat_ring


def test_outlines_close_and_keep_holes():
    """A ring of 8 quads: one chart with an outer and an inner loop."""
    ring, faces = flat_ring(0.5, 1.0, 8)
    uv = ring * 0.4 + 0.5
    scene = make_scene(np.concatenate([ring, np.zeros((16, 1))], 1), faces, uv, faces)
    loops = outlines(scene)
    assert [(chart, len(p)) for chart, p in loops] == [(0, 8), (0, 8)]
    for _, p in loops:
        step = np.linalg.norm(np.roll(p, -1, 0) - p, axis=1)
        assert step.max() < 0.4  # neighbours along the ring, no jumps


def area_of(path: str) -> float:
    """Area inside all loops of a path, holes taken off: loops of one chart run round it with one hand."""
    total = 0.0
    for loop in re.findall(r"M([^Z]+)Z", path):
        p = np.array([[float(c) for c in pair.split(",")] for pair in loop.split()])
        total += np.sum(p[:, 0] * np.roll(p[:, 1], -1) - np.roll(p[:, 0], -1) * p[:, 1]) / 2
    return abs(total)


def test_three_squares_and_every_face_in_each():
    """Layout, checker and distortion cover the same area: that of the uv."""
    points, faces, uv, uv_faces = cube()
    uv[0] = uv[0] * 0.9 + uv[2] * 0.1  # one side is distorted
    scene = make_scene(points, faces, uv, uv_faces)
    root = ET.fromstring(figure_svg(scene, PictureOptions()))
    name = "{http://www.w3.org/2000/svg}"
    groups = {g.get("id"): g for g in root.iter(f"{name}g") if g.get("id")}
    assert list(groups) == ["layout", "checker", "distortion"]
    whole = float(np.abs(scene.uv_areas).sum()) * 1e6
    wide, high = (float(x) for x in root.get("viewBox").split()[2:])
    assert wide >= 3 * 1000
    assert high >= 1000
    layout = [p.get("d") for p in groups["layout"].iter(f"{name}path") if p.get("id")]
    assert sum(map(area_of, layout)) == pytest.approx(whole, rel=1e-4)
    every = groups["checker"].iter(f"{name}path")
    (cells,) = [p for p in every if p.get("id") == "cells-on-charts"]
    assert cells.get("fill") == "url(#cells)"
    assert area_of(cells.get("d")) == pytest.approx(whole, rel=1e-4)
    fills = {p.get("fill"): p.get("d") for p in groups["distortion"].iter(f"{name}path")}
    drawn = {fill: d for fill, d in fills.items() if fill != "none" and d.count("Z")}
    assert sum(map(area_of, drawn.values())) == pytest.approx(whole, rel=1e-4)
    assert len(drawn) > 1  # faces of several steps of the scale
    loops = sum(d.count("Z") for d in drawn.values())
    assert loops < len(scene.faces)  # neighbours of one step have one outline
    beyond = figure_svg(scene, PictureOptions(scale_end=1.0001))
    assert FLIP not in beyond  # what is beyond the scale has its last colour, no face is flipped


def test_the_checker_begins_at_uv_zero():
    """A field of the pattern is as large as checker_cells says, and its corner lies on uv 0."""
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv - 0.3, uv_faces)
    root = ET.fromstring(figure_svg(scene, PictureOptions()))
    pattern = next(root.iter("{http://www.w3.org/2000/svg}pattern"))
    u0, _, _, v1 = scene.bounds
    cell = 1000 / checker_cells(scene)
    assert float(pattern.get("width")) == pytest.approx(2 * cell, rel=1e-4)
    for at, origin in ((pattern.get("x"), -u0 * 1000), (pattern.get("y"), v1 * 1000)):
        fields = (float(at) - origin) / (2 * cell)
        assert fields == pytest.approx(round(fields), abs=1e-4)


def test_a_title_of_any_characters_is_xml():
    text = figure_svg(flat_quad(), PictureOptions(title="a\udc80b\x07<c>"))
    assert ET.fromstring(text.encode("utf-8")) is not None
