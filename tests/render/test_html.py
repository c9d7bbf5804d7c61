"""The page: small, well-formed, safe against its texts; one layout, or two beside each other."""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from circparam.render.figures import PageImages, PictureOptions
from circparam.render.html import page
from circparam.render.scene import make_scene, with_instances
from tests.support.scenes import cube

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def test_page_is_one_file_that_asks_for_nothing():
    look = PictureOptions(title='a <b> & "c" %META%', repairs=("<script>x",))
    text = page(make_scene(*cube()), look)
    assert "default-src 'none'" in text
    assert not re.search(r"""(src|href)=["'](?!data:)""", text)
    assert "fetch(" not in text
    assert "<script>x" not in text
    assert text.count("</script>") == text.count("<script")
    assert "%STYLE%" not in text
    title = re.search(r"<title>(.*?)</title>", text)  # a title is text, not a place to fill
    assert title.group(1) == "a &lt;b&gt; &amp; &quot;c&quot; %META%"
    meta = meta_of(text)
    assert len(meta["charts"]["faces"]) == 6
    assert sum(meta["charts"]["share"]) == pytest.approx(1, abs=1e-3)


def test_textures_become_runs_of_faces():
    scene = make_scene(*cube())
    face = np.array([1, 0, 1, 0, -1, 0, 1, 1, 0, 0, -1, 1])
    text = page(scene, PictureOptions(images=PageImages([(PNG, "image/png")] * 2, face)))
    meta = meta_of(text)
    assert meta["ranges"] == [
        {"image": -1, "first": 0, "count": 2},
        {"image": 0, "first": 2, "count": 5},
        {"image": 1, "first": 7, "count": 5},
    ]
    assert meta["images"][0].startswith("data:image/png;base64,")


def meta_of(text: str) -> dict:
    found = re.search(r'id="meta">(.*?)</script>', text, re.S)
    out: dict = json.loads(found.group(1))
    return {**out, **out["layouts"][-1]}


def test_all_pages_have_one_scale_unless_asked():
    """So that pictures of different meshes compare."""
    points, faces, uv, uv_faces = cube()
    for squeeze in (1.0, 0.2):
        meta = meta_of(page(make_scene(points, faces, uv * [1, squeeze], uv_faces)))
        assert meta["distortionEnd"] == 2.0
        assert 2.0 in meta["distortionEnds"]
    meta = meta_of(page(make_scene(points, faces, uv, uv_faces), PictureOptions(scale_end=7.0)))
    assert meta["distortionEnd"] == 7.0


def test_copies_are_in_the_page_with_their_images():
    """The geometry holds them, what is said of charts does not count them."""
    scene = make_scene(*cube())
    move = np.eye(4)
    move[:3, 3] = 5
    shown = with_instances(scene, [(np.arange(4), move)])
    image = np.array([1] * 2 + [0] * 4 + [-1] * 6)
    meta = meta_of(page(shown, PictureOptions(images=PageImages([(PNG, "image/png")] * 2, image))))
    assert [r["count"] for r in meta["ranges"]] == [6, 6, 4]
    assert sum(meta["charts"]["faces"]) == 12
    side = next(s for s in meta["sections"] if s["name"] == "side")
    assert side["count"] == 16


def test_names_that_are_not_utf_8_do_not_stop_a_page():
    text = page(make_scene(*cube()), PictureOptions(title="a\udc80<", repairs=("\udcff",)))
    assert text.encode("utf-8")
    assert "<title>a?&lt;</title>" in text


def test_a_page_without_targets_has_no_slider():
    scene = make_scene(*cube())
    text = page(replace(scene, targets=(("<b>", scene.points.copy()),)))
    assert 'id="morph-0"' in text
    assert "&lt;b&gt;" in text
    assert "<b>" not in text
    assert 'id="morph-0"' not in page(scene)


def test_copies_take_their_targets_along():
    scene = make_scene(*cube())
    scene = replace(scene, targets=(("up", scene.points + np.array([0.0, 0, 5])),))
    matrix = np.diag([2.0, 1, 1, 1])
    matrix[:3, 3] = [10, 0, 0]
    both = with_instances(scene, [(np.arange(len(scene.faces)), matrix)])
    ((_, points),) = both.targets
    step = points[both.faces] - both.points[both.faces]
    assert np.allclose(step, [0, 0, 5])
