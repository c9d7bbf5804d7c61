"""The layout as SVG."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np

from circparam.render.scene import make_scene
from circparam.render.svg import layout_svg, outlines
from tests.support.scenes import cube


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
