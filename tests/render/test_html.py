"""The page: geometry that comes back within its quantisation; small, well-formed, safe against its texts."""

from __future__ import annotations

import base64
import json
import re
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.render import colours as col
from circparam.render.figures import PageImages, PictureOptions
from circparam.render.html import fill_in, pack_geometry, page
from circparam.render.scene import Scene, make_scene, with_copies
from tests.support.scenes import cube, flat_quad

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def unpack(sections: list[dict], packed: bytes) -> dict[str, np.ndarray]:
    """What decode.js does, in NumPy: planes → columns → sums → numbers."""
    data, offset, out = zlib.decompress(packed), 0, {}
    for s in sections:
        n, columns, width = s["count"], s["columns"], s["bytes"]
        size = n * columns * width
        planes = np.frombuffer(data, np.uint8, size, offset).reshape(columns, width, n)
        offset += size
        table = np.ascontiguousarray(planes.transpose(2, 0, 1)).view(f"<u{width}")[..., 0]
        if s["coding"] == "delta":
            table = np.cumsum(table, axis=0, dtype=table.dtype)
        elif s["coding"] == "newest":
            numbers, new = [], 0
            for code in table[:, 0].tolist():
                numbers.append(new - code)
                new += code == 0
            table = np.array(numbers)[:, None]
        out[s["name"]] = table
    assert offset == len(data)
    return out


def check_geometry(scene: Scene, order: np.ndarray) -> dict[str, np.ndarray]:
    """Every corner of every face comes back where it was, to a step of 16 bit."""
    out = unpack(*pack_geometry(scene, order))
    index = out["index"][:, 0].reshape(-1, 3)
    low = scene.used_points.min(0)
    extent = np.ptp(scene.used_points, axis=0)
    position = low + out["position"][index] / 65535 * extent
    assert np.abs(position - scene.points[scene.faces[order]]).max() <= 0.51 * extent.max() / 65535
    span = np.ptp(scene.uv, axis=0)
    mapped = scene.mapped[order]
    uv = scene.uv.min(0) + out["uv"][index][mapped] / 65535 * span
    assert np.abs(uv - scene.corner_uv[order][mapped]).max() <= 0.51 * span.max() / 65535
    chart = out["chart"][:, 0].astype(np.int64)
    assert np.array_equal(np.where(chart == 0xFFFFFFFF, -1, chart), scene.chart[order])
    return out


def test_geometry_comes_back():
    scene = make_scene(*cube())
    out = check_geometry(scene, np.arange(12))
    assert out["seams"][:, 0].tolist() == scene.seams.tolist()
    turned = check_geometry(scene, np.arange(12)[::-1])
    face, side = turned["seams"][:, 0] // 3, turned["seams"][:, 0] % 3
    assert sorted((3 * (11 - face) + side).tolist()) == scene.seams.tolist()
    assert len(check_geometry(flat_quad(), np.arange(2))["seams"]) == 4


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_any_soup_in_any_order_comes_back(seed: int):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(9, 3))
    faces = rng.integers(0, 9, (14, 3))
    uv = rng.random((11, 2))
    uv_faces = rng.integers(0, 11, (14, 3))
    uv_faces[rng.random(14) < 0.2] = -1
    uv_faces[0] = [0, 1, 2]
    check_geometry(make_scene(points, faces, uv, uv_faces), rng.permutation(14))


def test_normals_survive_the_octahedron():
    scene = make_scene(*cube())
    out = unpack(*pack_geometry(scene, np.arange(12)))
    e = out["normal"] / 255 * 2 - 1
    n = np.concatenate([e, 1 - np.abs(e).sum(1, keepdims=True)], 1)
    t = np.maximum(-n[:, 2:], 0)
    n[:, :2] += np.where(n[:, :2] >= 0, -t, t)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    index = out["index"][:, 0].reshape(-1, 3)
    assert np.abs(n[index] - scene.corner_normals).max() < 0.02


def test_distortion_codes_grow_and_mark_flips():
    points, faces, uv, uv_faces = cube()
    uv[1] = uv[0] + (uv[3] - uv[0]) * [1, 1]
    scene = make_scene(points, faces, uv, uv_faces)
    code = unpack(*pack_geometry(scene, np.arange(12)))["distortion"][:, 0]
    plain = ~scene.flipped
    order = np.argsort(scene.distortion[plain], kind="stable")
    assert (np.diff(code[plain][order].astype(int)) >= 0).all()
    assert (code[scene.flipped] == 255).all()
    back = np.exp((code[plain] / 254.0) ** 2 * np.log(1000))
    finite = np.isfinite(scene.distortion[plain])
    assert np.abs(back / scene.distortion[plain] - 1)[finite].max() < 0.05


def test_page_is_one_file_that_asks_for_nothing():
    text = page(
        make_scene(*cube()), PictureOptions(title='a <b> & "c" %META%', repairs=("<script>x",))
    )
    assert "default-src 'none'" in text
    assert not re.search(r"""(src|href)=["'](?!data:)""", text)
    assert "fetch(" not in text
    assert "<script>x" not in text
    assert text.count("</script>") == text.count("<script")
    assert "%STYLE%" not in text
    title = re.search(r"<title>(.*?)</title>", text)
    assert title is not None
    assert (
        title.group(1) == "a &lt;b&gt; &amp; &quot;c&quot; %META%"
    )  # a title is text, not a place to fill
    meta = json.loads(re.search(r'id="meta">(.*?)</script>', text, re.S).group(1))
    assert len(meta["charts"]["faces"]) == 6
    assert sum(meta["charts"]["share"]) == pytest.approx(1, abs=1e-3)


def test_textures_become_runs_of_faces():
    scene = make_scene(*cube())
    face = np.array([1, 0, 1, 0, -1, 0, 1, 1, 0, 0, -1, 1])
    text = page(scene, PictureOptions(images=PageImages([(PNG, "image/png")] * 2, face)))
    meta = json.loads(re.search(r'id="meta">(.*?)</script>', text, re.S).group(1))
    assert meta["ranges"] == [
        {"image": -1, "first": 0, "count": 2},
        {"image": 0, "first": 2, "count": 5},
        {"image": 1, "first": 7, "count": 5},
    ]
    assert meta["images"][0].startswith("data:image/png;base64,")


def test_fill_in_leaves_what_it_does_not_know():
    assert fill_in("50 % of %A% and %B% 100%", {"A": "%B%"}) == "50 % of %B% and %B% 100%"


def test_large_meshes_stay_small():
    """Twenty bytes a face at most: 500k faces in 10 MB of page, whose limit is 15 MB."""
    n = 150
    rng = np.random.default_rng(0)
    g = np.linspace(0, 1, n + 1)
    x, y = np.meshgrid(g, g)
    points = np.stack([x.ravel(), y.ravel(), rng.normal(0, 0.01, x.size)], 1)
    points[:, :2] += rng.normal(0, 0.1 / n, (x.size, 2))
    uv = points[:, :2] + rng.normal(0, 0.1 / n, (x.size, 2))
    i = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].ravel()
    faces = np.concatenate(
        [np.stack([i, i + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + n + 1], 1)]
    )
    faces = faces[rng.permutation(len(faces))]  # as badly ordered as a file can be
    text = page(make_scene(points, faces, uv, faces))
    fixed = 60_000
    assert len(text) < fixed + 20 * len(faces)


def meta_of(text: str) -> dict:
    found = re.search(r'id="meta">(.*?)</script>', text, re.S)
    assert found is not None
    out: dict = json.loads(found.group(1))
    return out


def test_all_pages_have_one_scale_unless_asked():
    """So that pictures of different meshes compare."""
    points, faces, uv, uv_faces = cube()
    for squeeze in (1.0, 0.2):
        meta = meta_of(page(make_scene(points, faces, uv * [1, squeeze], uv_faces)))
        assert meta["distortionEnd"] == 2.0
        assert 2.0 in meta["distortionEnds"]
    meta = meta_of(page(make_scene(points, faces, uv, uv_faces), PictureOptions(scale_end=7.0)))
    assert meta["distortionEnd"] == 7.0


def test_both_schemes_are_in_the_page():
    text = page(make_scene(*cube()))
    assert "@media (prefers-color-scheme: dark)" in text
    schemes = meta_of(text)["schemes"]
    for name, code in (("light", col.LIGHT), ("dark", col.DARK)):
        assert schemes[name] == {key.lower(): value for key, value in code.items()}
        assert all(value in text.split("</style>")[0] for value in code.values())


def test_copies_are_in_the_page_with_their_images():
    """The geometry holds them, what is said of charts does not count them."""
    scene = make_scene(*cube())
    move = np.eye(4)
    move[:3, 3] = 5
    shown = with_copies(scene, [(np.arange(4), move)])
    image = np.array([1] * 2 + [0] * 4 + [-1] * 6)
    meta = meta_of(page(shown, PictureOptions(images=PageImages([(PNG, "image/png")] * 2, image))))
    assert [r["count"] for r in meta["ranges"]] == [6, 6, 4]
    assert sum(meta["charts"]["faces"]) == 12
    index = next(s for s in meta["sections"] if s["name"] == "index")
    assert index["count"] == 3 * 16


def test_names_that_are_not_utf_8_do_not_stop_a_page():
    text = page(make_scene(*cube()), PictureOptions(title="a\udc80<", repairs=("\udcff",)))
    assert text.encode("utf-8")
    assert "<title>a?&lt;</title>" in text


def test_morph_targets_come_back_and_nothing_else_grows():
    """What decode.js adds up is the target's place; a page without targets has no slider."""
    scene = make_scene(*cube())
    rng = np.random.default_rng(0)
    moved = scene.points + rng.normal(size=scene.points.shape)
    still = replace(scene, targets=(("<b>", scene.points.copy()),))
    scene = replace(scene, targets=(("one", moved), ("two", 3 * scene.points)))
    order = np.arange(len(scene.faces))[::-1]
    out = unpack(*pack_geometry(scene, order))
    index = out["index"][:, 0].reshape(-1, 3)
    every = np.concatenate([scene.points, moved, 3 * scene.points])
    low, extent = every.min(0), np.ptp(every, axis=0)
    for k, points in enumerate((moved, 3 * scene.points)):
        code = (out["position"].astype(np.int64) + out[f"move{k}"]) & 0xFFFF
        assert np.abs(low + code[index] / 65535 * extent - points[scene.faces[order]]).max() < 1e-3
    assert not unpack(*pack_geometry(still, order))["move0"].any()
    text = page(still)
    assert 'id="morph-0"' in text
    assert "&lt;b&gt;" in text
    assert "<b>" not in text
    assert 'id="morph-0"' not in page(make_scene(*cube()))


def test_copies_take_their_targets_along():
    scene = make_scene(*cube())
    scene = replace(scene, targets=(("up", scene.points + np.array([0.0, 0, 5])),))
    matrix = np.diag([2.0, 1, 1, 1])
    matrix[:3, 3] = [10, 0, 0]
    both = with_copies(scene, [(np.arange(len(scene.faces)), matrix)])
    ((_, points),) = both.targets
    step = points[both.faces] - both.points[both.faces]
    assert np.allclose(step, [0, 0, 5])
