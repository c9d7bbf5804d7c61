"""The geometry of a page comes back as it was, within its quantisation, and takes few bytes."""

import base64
import json
import subprocess
import zlib
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.render.packed import Packed, pack_geometry
from circparam.render.scene import Scene, make_scene
from tests.support import shapes
from tests.support.node import NODE
from tests.support.scenes import cube


def planes(packed: Packed) -> dict[str, tuple[np.ndarray, str]]:
    """The tables as they are stored, by name, with their coding."""
    data, offset, out = zlib.decompress(packed.data), 0, {}
    for s in packed.sections:
        n, columns, width = s["count"], s["columns"], s["bytes"]
        size = n * columns * width
        stored = np.frombuffer(data, np.uint8, size, offset).reshape(columns, width, n)
        offset += size
        table = np.ascontiguousarray(stored.transpose(2, 0, 1)).view(f"<u{width}")[..., 0]
        out[s["name"]] = (table, s["coding"])
    assert offset == len(data)
    return out


def tree(parent: list[int], side: list[int], code: list[int]) -> tuple[list[int], list[list[int]]]:
    """Corners of all faces, and the three earlier vertices that predict each vertex."""
    index: list[int] = []
    near: list[list[int]] = []
    codes = iter(code)

    def corner(*predictors: int) -> None:
        v = len(near) - next(codes)
        if v == len(near):
            near.append(list(predictors))
        index.append(v)

    for p, s in zip(parent, side, strict=True):
        if s == 3:
            for _ in range(3):
                corner(*[max(len(near) - 1, 0)] * 3)
        else:
            a, b = index[3 * p + (s + 1) % 3], index[3 * p + s]
            index += [a, b]
            corner(a, b, index[3 * p + (s + 2) % 3])
    return index, near


def unpack(packed: Packed) -> dict[str, np.ndarray]:
    """What decode.js does, in Python."""
    out: dict[str, np.ndarray] = {}
    for name, (table, coding) in planes(packed).items():
        values = table.copy()
        if coding == "sum":
            values = np.cumsum(values, axis=0, dtype=values.dtype)
        elif coding in ("parallelogram", "mean"):
            whole, most = values.astype(np.int64), 1 << 8 * values.dtype.itemsize
            for v, (a, b, c) in enumerate(out["near"]):
                told = whole[a] + whole[b]
                told = told - whole[c] if coding == "parallelogram" else told >> 1
                difference = (whole[v] >> 1) ^ -(whole[v] & 1)
                whole[v] = ((told if v else 0) + difference) % most
            values = whole
        out[name] = values[:, 0] if values.shape[1] == 1 else values
        if name == "corner":
            index, near = tree(*(out[k].tolist() for k in ("parent", "side", "corner")))
            out["index"], out["near"] = np.array(index).reshape(-1, 3), np.array(near)
    return out


def turned(found: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(m, 3) which corner of each face (m, 3, 3) each one found is, where faces are turned, not flipped."""
    turns = (np.arange(3) + np.arange(3)[:, None]) % 3
    away = np.stack([np.abs(found - corners[:, t]).max((1, 2)) for t in turns])
    return turns[away.argmin(0)]


def check_geometry(scene: Scene, group: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Every corner of every face comes back where it was, to a step of 16 bit; so do charts and seams."""
    packed = pack_geometry(scene, group)
    out, order = unpack(packed), packed.order
    index = out["index"]
    assert np.array_equal(np.sort(order), np.arange(len(scene.faces)))
    low = scene.used_points.min(0)
    extent = np.ptp(scene.used_points, axis=0)
    position = low + out["position"][index] / 65535 * extent
    turn = turned(position, scene.points[scene.faces[order]])
    corner = np.arange(len(order))[:, None], turn
    there = scene.points[scene.faces[order]][corner]
    assert np.abs(position - there).max() <= 0.51 * extent.max() / 65535
    span = np.ptp(scene.uv, axis=0)
    mapped = scene.mapped[order]
    uv = scene.uv.min(0) + out["uv"][index][mapped] / 65535 * span
    assert np.abs(uv - scene.corner_uv[order][corner][mapped]).max() <= 0.51 * span.max() / 65535
    chart = out["chart"].astype(np.int64)
    assert np.array_equal(np.where(chart == 0xFFFFFFFF, -1, chart), scene.chart[order])
    start = 3 * order[out["seams"] // 3] + turn[out["seams"] // 3, out["seams"] % 3]
    assert sorted(start.tolist()) == scene.seams.tolist()
    return out


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_any_soup_comes_back(seed: int):
    """Faces that fold onto each other, share two edges or run against each other, with and without uv."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(9, 3))
    faces = rng.permuted(np.tile(np.arange(9), (14, 1)), axis=1)[:, :3]
    uv = rng.random((11, 2))
    uv_faces = faces + 2 * (rng.random((14, 3)) < 0.3)
    uv_faces[rng.random(14) < 0.2] = -1
    uv_faces[0] = faces[0]
    check_geometry(make_scene(points, faces, uv, uv_faces), rng.integers(0, 3, 14))


READ = """
const fs = require("fs"), zlib = require("zlib");
const [code, file] = process.argv.slice(1), { sections, data } = JSON.parse(fs.readFileSync(file));
const mesh = new Function("data", "sections", fs.readFileSync(code) + "return readSections(data, sections);")(
  new Uint8Array(zlib.inflateSync(Buffer.from(data, "base64"))), sections);
console.log(JSON.stringify(Object.fromEntries(Object.entries(mesh).map(([k, v]) => [k, [...v]]))));
"""


@pytest.mark.skipif(NODE is None, reason="not installed: node")
def test_the_page_reads_what_was_written(tmp_path: Path):
    """decode.js agrees with the reader of these tests, on a soup and on a torus without a seam."""
    rng = np.random.default_rng(3)
    soup = rng.permuted(np.tile(np.arange(9), (14, 1)), axis=1)[:, :3]
    t = np.arange(64)
    quads = np.stack([t, 8 * (t // 8) + (t + 1) % 8, (t + 8) % 64], 1)
    other = np.stack([quads[:, 2], quads[:, 1], np.roll(quads[:, 1], -8)], 1)
    torus = np.concatenate([quads, other])
    for faces, n in ((soup, 9), (torus, 64)):
        scene = make_scene(rng.normal(size=(n, 3)), faces, rng.random((n, 2)), faces)
        packed = pack_geometry(scene)
        file = tmp_path / f"{n}.json"
        encoded = base64.b64encode(packed.data).decode()
        file.write_text(json.dumps({"sections": packed.sections, "data": encoded}))
        code = resources.files("circparam.render") / "viewer" / "decode.js"
        words = [str(NODE), "-e", READ, str(code), str(file)]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        read, own = json.loads(done.stdout), unpack(packed)
        assert {"index", "position", "uv", "normal", "chart", "seams"} <= read.keys()
        for name, values in read.items():
            assert values == own[name].ravel().tolist(), name


def test_normals_survive_the_octahedron():
    scene = make_scene(*cube())
    packed = pack_geometry(scene)
    out = unpack(packed)
    e = out["normal"] / 255 * 2 - 1
    n = np.concatenate([e, 1 - np.abs(e).sum(1, keepdims=True)], 1)
    t = np.maximum(-n[:, 2:], 0)
    n[:, :2] += np.where(n[:, :2] >= 0, -t, t)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    away = np.abs(n[out["index"]] - scene.corner_normals[packed.order])  # sides are flat
    assert away.max() < 0.02


def test_distortion_codes_grow_and_mark_flips():
    points, faces, uv, uv_faces = cube()
    uv[1] = uv[0] + (uv[3] - uv[0]) * [1, 1]
    scene = make_scene(points, faces, uv, uv_faces)
    packed = pack_geometry(scene)
    code = np.empty(12, np.int64)
    code[packed.order] = unpack(packed)["distortion"]
    plain = ~scene.flipped
    order = np.argsort(scene.distortion[plain], kind="stable")
    assert (np.diff(code[plain][order].astype(int)) >= 0).all()
    assert (code[scene.flipped] == 255).all()
    back = np.exp((code[plain] / 254.0) ** 2 * np.log(1000))
    finite = np.isfinite(scene.distortion[plain])
    assert np.abs(back / scene.distortion[plain] - 1)[finite].max() < 0.05


def test_morph_targets_come_back_and_nothing_else_grows():
    """What decode.js adds up is the target's place; a target that moves nothing is all zeros."""
    scene = make_scene(*cube())
    rng = np.random.default_rng(0)
    moved = scene.points + rng.normal(size=scene.points.shape)
    still = replace(scene, targets=(("still", scene.points.copy()),))
    scene = replace(scene, targets=(("one", moved), ("two", 3 * scene.points)))
    packed = pack_geometry(scene)
    out = unpack(packed)
    every = np.concatenate([scene.points, moved, 3 * scene.points])
    low, extent = every.min(0), np.ptp(every, axis=0)
    for k, points in enumerate((moved, 3 * scene.points)):
        code = (out["position"].astype(np.int64) + out[f"move{k}"]) & 0xFFFF
        place = low + code[out["index"]] / 65535 * extent
        there = points[scene.faces[packed.order]]
        assert np.abs(np.sort(place, 1) - np.sort(there, 1)).max() < 1e-3
    assert not unpack(pack_geometry(still))["move0"].any()


def test_a_smooth_surface_takes_few_bytes():
    """Less than five bytes a face: 100,000 faces in half a megabyte."""
    n = 60
    points, faces = shapes.grid(n + 1, n + 1)
    points[:, 2] = 0.2 * np.sin(7 * points[:, 0]) * np.cos(5 * points[:, 1])
    rng = np.random.default_rng(0)
    faces = faces[rng.permutation(len(faces))]  # the order of a file does not matter
    uv = points[:, :2] + rng.normal(0, 0.02 / n, (len(points), 2))
    scene = make_scene(points, faces, uv, faces)
    assert len(pack_geometry(scene).data) < 5 * len(faces)
