"""Colours carried into a layout: known surfaces, what comes back, and what is refused."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.bake.bake import Baked, bake, bake_document, dilate, sample_back
from circparam.bake.sampling import Closest, bilinear, closest_on_triangles, corner_paint
from circparam.bake.write import join, split, write_baked
from circparam.core.arrays import FloatArray
from circparam.errors import InputError, OptionError
from circparam.formats.document import WriteOptions
from circparam.formats.io import read, write
from circparam.mesh.mesh import UVMap


def sheet(n: int) -> tuple[FloatArray, np.ndarray]:
    """The unit square as an n × n grid of squares, in space."""
    g = np.linspace(0, 1, n + 1)
    x, y = np.meshgrid(g, g)
    i = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].ravel()
    faces = np.concatenate(
        [np.stack([i, i + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + n + 1], 1)]
    )
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], 1), faces


def smooth(p: FloatArray) -> FloatArray:
    """A colour for every point of the sheet."""
    return np.stack([p[:, 0], p[:, 1], 0.5 + 0.5 * np.sin(3 * p[:, 0]) * np.cos(2 * p[:, 1])], 1)


def charts(points: FloatArray, faces: np.ndarray) -> UVMap:
    """The sheet as two charts, cut at x = 1/2, turned and set apart."""
    left = points[faces].mean(1)[:, 0] < 0.5
    a = points[:, :2] * [0.8, 0.8] + [0.05, 0.1]
    b = points[:, [1, 0]] * [0.8, -0.8] + [0.05, 0.0]
    b[:, 1] += 0.98 - b[:, 1].max()
    scale = np.array([0.5, 1.0])
    uv = np.concatenate([a * scale, b * scale + [0.5, 0.0]])
    return UVMap(uv, np.where(left[:, None], faces, faces + len(points)))


def some_places(m: int, n: int = 4000) -> tuple[np.ndarray, FloatArray]:
    rng = np.random.default_rng(5)
    bary = rng.dirichlet([1, 1, 1], n)
    return rng.integers(0, m, n), bary


def test_vertex_colours_come_back():
    points, faces = sheet(12)
    layout = charts(points, faces)
    colours = smooth(points)
    baked = bake(layout, corner_paint(colours[faces]), 256)
    face, bary = some_places(len(faces))
    truth = np.einsum("pk,pkc->pc", bary, colours[faces[face]])
    error = np.abs(sample_back(baked, layout, face, bary) - truth)
    assert error.mean() < 1 / 255
    assert error.max() < 8 / 255  # at the borders too: the colours reach into the padding


def test_texel_is_the_colour_at_its_centre():
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    layout = UVMap(uv, np.array([[0, 1, 2], [0, 2, 3]]))
    corners = np.stack([uv[:, 0], uv[:, 1], np.zeros(4)], 1)[layout.uv_faces]
    image = bake(layout, corner_paint(corners), 4).tiles[0, 0]
    at = (np.arange(4) + 0.5) / 4
    assert np.allclose(image[:, :, 0], np.round(at * 255)[None, :], atol=1)
    assert np.allclose(image[:, :, 1], np.round(at[::-1] * 255)[:, None], atol=1)  # v points up


def test_dilation_takes_the_nearest_colour():
    image = np.zeros((5, 5, 3), np.uint8)
    mask = np.zeros((5, 5), bool)
    mask[0, 0] = mask[4, 4] = True
    image[0, 0], image[4, 4] = 10, 200
    out = dilate(image, mask)
    assert (out[0, 1] == 10).all()
    assert (out[4, 3] == 200).all()
    assert set(np.unique(out)) == {10, 200}


def test_bilinear_repeats_and_hits_texel_centres():
    image = np.arange(12, dtype=float).reshape(3, 4, 1)
    centres = np.array([[(x + 0.5) / 4, 1 - (y + 0.5) / 3] for y in range(3) for x in range(4)])
    assert np.allclose(bilinear(image, centres)[:, 0], np.arange(12))
    assert np.allclose(bilinear(image, centres + np.array([2.0, -3.0]))[:, 0], np.arange(12))


def test_tiles_become_images_of_their_own():
    points, faces = sheet(2)
    uv = np.concatenate([points[:, :2] * 0.9 + 0.05, points[:, :2] * 0.9 + [1.05, 0.05]])
    layout = UVMap(uv, np.concatenate([faces, faces + len(points)]))
    red, blue = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    corners = np.concatenate([np.tile(red, (len(faces), 3, 1)), np.tile(blue, (len(faces), 3, 1))])
    baked = bake(layout, corner_paint(corners), 8)
    assert sorted(baked.tiles) == [(0, 0), (1, 0)]
    assert (baked.tiles[0, 0] == [255, 0, 0]).all()
    assert (baked.tiles[1, 0] == [0, 0, 255]).all()


@pytest.mark.parametrize(
    ("uv", "message"),
    [
        (np.array([[0.0, 0], [1.5, 0], [0, 1.0]]), "unit tile"),
        (np.array([[-0.2, 0], [0.5, 0], [0, 1.0]]), "unit tile"),
        (np.array([[np.nan, 0], [1.0, 0], [0, 1.0]]), "NaN"),
        (np.array([[0.0, 0], [1e-9, 0], [0, 1e-9]]), "too small"),
    ],
)
def test_layouts_that_hold_no_image(uv: FloatArray, message: str):
    layout = UVMap(uv, np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match=message):
        bake(layout, corner_paint(np.ones((1, 3, 3))), 16)


def test_no_uv_and_bad_sizes():
    with pytest.raises(InputError, match="circparam unwrap"):
        bake(UVMap(np.zeros((0, 2)), np.full((1, 3), -1)), corner_paint(np.ones((1, 3, 3))), 16)
    layout = UVMap(np.eye(3)[:, :2], np.array([[0, 1, 2]]))
    for size in (0, 20_000):
        with pytest.raises(OptionError, match="size"):
            bake(layout, corner_paint(np.ones((1, 3, 3))), size)


def test_overlapping_faces_are_told():
    uv = np.array([[0.0, 0], [1, 0], [0, 1.0]])
    layout = UVMap(uv, np.array([[0, 1, 2], [0, 1, 2]]))
    baked = bake(layout, corner_paint(np.ones((2, 3, 3))), 32)
    assert any("several faces" in note for note in baked.notes)


def test_closest_point_against_brute_force():
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(60, 3, 3))
    places = 2 * rng.normal(size=(60, 3))
    bary, d2 = closest_on_triangles(places, corners)
    assert np.allclose(bary.sum(1), 1)
    assert bary.min() >= 0
    # no point of a dense sampling of the triangle is nearer
    grid = np.array([[i, j, 40 - i - j] for i in range(41) for j in range(41 - i)]) / 40
    dense = np.einsum("gk,fkc->fgc", grid, corners)
    best = ((dense - places[:, None]) ** 2).sum(2).min(1)
    assert (d2 <= best + 1e-12).all()
    assert (best - d2 < 0.3).all()


def test_closest_finds_points_on_a_surface_exactly():
    points, faces = sheet(9)
    points[:, 2] = 0.2 * np.sin(4 * points[:, 0])
    face, bary = some_places(len(faces), 500)
    places = np.einsum("pk,pkc->pc", bary, points[faces[face]])
    _, _, distance = Closest(points, faces).find(places)
    assert distance.max() < 1e-12


def test_samples_lie_on_their_faces_and_cover_them_evenly():
    """The nearest sample leads to the face sought: one beside its face leads elsewhere."""
    points, faces = sheet(3)
    points[:, 2] = np.sin(3 * points[:, 0])
    closest = Closest(points, faces)
    bary, apart = closest_on_triangles(np.asarray(closest.tree.data), points[faces[closest.face]])
    assert apart.max() < 1e-24
    area = np.linalg.norm(
        np.cross(*(points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))), axis=1
    )
    wanted = area / area.sum() * len(bary)
    assert np.bincount(closest.face) == pytest.approx(wanted, abs=3)
    for f in range(len(faces)):
        own = bary[closest.face == f]
        # of a uniform spread over a triangle: mean 1/3, variance 1/18
        assert own.mean(0) == pytest.approx([1 / 3] * 3, abs=0.01)
        assert own.var(0) == pytest.approx([1 / 18] * 3, abs=0.005)


# files ---------------------------------------------------------------------------------------------


def write_obj(
    path: Path, points: FloatArray, layout: UVMap, faces: np.ndarray, colours=None, mtl=""
):
    rows = points if colours is None else np.concatenate([points, colours], 1)
    lines = [f"mtllib {mtl}", "usemtl m"] if mtl else []
    lines += ["v " + " ".join(repr(float(c)) for c in row) for row in rows]
    lines += [f"vt {u!r} {v!r}" for u, v in layout.uv.tolist()]
    lines += [
        "f " + " ".join(f"{a + 1}/{b + 1}" for a, b in zip(f, t, strict=True))
        for f, t in zip(faces.tolist(), layout.uv_faces.tolist(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")


def picture(path: Path, n: int = 128) -> None:
    """A smooth image, bright where u and v are large."""
    x, y = np.meshgrid((np.arange(n) + 0.5) / n, 1 - (np.arange(n) + 0.5) / n)
    rgb = np.stack([x, y, 0.5 + 0.4 * np.sin(4 * x + 3 * y)], 2)
    Image.fromarray(np.round(rgb * 255).astype(np.uint8)).save(path)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """old.obj with a texture, new.obj with the same faces in another layout."""
    points, faces = sheet(10)
    old = UVMap(points[:, :2].copy(), faces)
    picture(tmp_path / "skin.png")
    (tmp_path / "m.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd .\\skin.png\n")
    write_obj(tmp_path / "old.obj", points, old, faces, mtl="m.mtl")
    write_obj(tmp_path / "new.obj", points, charts(points, faces), faces)
    return tmp_path


def back(baked: Baked, folder: Path) -> float:
    """Mean error of the baked layout against the old texture, over the surface."""
    new, old = read(folder / "new.obj"), read(folder / "old.obj")
    face, bary = some_places(len(new.mesh.faces))
    layout, before = new.uv(), old.uv()
    assert layout is not None
    assert before is not None
    image = np.asarray(Image.open(folder / "skin.png").convert("RGB"), float) / 255
    there = np.einsum("pk,pkc->pc", bary, before.uv[before.uv_faces[face]])
    # away from the texture's own edge, where repeating mixes both sides
    inner = ((there > 0.02) & (there < 0.98)).all(1)
    error = np.abs(sample_back(baked, layout, face, bary) - bilinear(image, there))[inner]
    return float(error.mean())


def test_old_texture_of_the_same_mesh(files: Path):
    baked = bake_document(
        read(files / "new.obj"), "texture", source=read(files / "old.obj"), size=512
    )
    assert back(baked, files) < 2 / 255
    assert not any("closest" in note for note in baked.notes)


def test_texture_of_another_mesh(files: Path):
    points, faces = sheet(7)  # the same place in space, other triangles
    write_obj(files / "other.obj", points, UVMap(points[:, :2].copy(), faces), faces, mtl="m.mtl")
    baked = bake_document(
        read(files / "new.obj"), "texture", source=read(files / "other.obj"), size=256
    )
    assert back(baked, files) < 2 / 255
    assert any("closest" in note for note in baked.notes)


def test_a_large_texture_is_averaged_not_skipped(files: Path):
    noise = np.random.default_rng(0).integers(0, 256, (1024, 1024, 3), dtype=np.uint8)
    Image.fromarray(noise).save(files / "skin.png")
    baked = bake_document(
        read(files / "new.obj"), "texture", source=read(files / "old.obj"), size=64
    )
    # one texel of 64 covers hundreds of the source: their mean is grey, a single one is noise
    assert np.std(baked.tiles[0, 0].astype(float)) < 20


@pytest.mark.parametrize(
    ("break_it", "message"),
    [
        (lambda d: (d / "skin.png").unlink(), "skin.png is missing"),
        (lambda d: (d / "m.mtl").unlink(), "m.mtl is missing"),
        (lambda d: (d / "skin.png").write_bytes(b"not an image"), "cannot be read"),
    ],
)
def test_missing_and_broken_textures(files: Path, break_it, message: str):
    break_it(files)
    with pytest.raises(InputError, match=message):
        bake_document(read(files / "new.obj"), "texture", source=read(files / "old.obj"), size=32)


def test_what_is_refused(files: Path):
    new, old = read(files / "new.obj"), read(files / "old.obj")
    with pytest.raises(InputError, match="no vertex colours"):
        bake_document(new, "vertex-colors", size=32)
    with pytest.raises(InputError, match="no texture"):
        bake_document(new, "texture", size=32)
    with pytest.raises(InputError, match="--source"):
        bake_document(old, "texture", size=32)  # the texture and the uv belong together already
    with pytest.raises(InputError, match="uv set 3"):
        bake_document(new, "vertex-colors", uv_set=3, size=32)
    with pytest.raises(OptionError, match="vertex-colors"):
        bake_document(new, "normals", size=32)


def test_obj_vertex_colours_and_huge_textures(files: Path, monkeypatch: pytest.MonkeyPatch):
    points, faces = sheet(4)
    layout = charts(points, faces)
    write_obj(files / "colours.obj", points, layout, faces, colours=smooth(points))
    baked = bake_document(read(files / "colours.obj"), "vertex-colors", size=64)
    face, bary = some_places(len(faces))
    truth = np.einsum("pk,pkc->pc", bary, smooth(points)[faces[face]])
    assert np.abs(sample_back(baked, layout, face, bary) - truth).mean() < 2 / 255
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    with pytest.raises(InputError, match="too large"):
        bake_document(read(files / "new.obj"), "texture", source=read(files / "old.obj"), size=32)


def test_ply_colours_of_vertices_and_of_faces(tmp_path: Path):
    points, faces = sheet(3)
    codes = np.round(smooth(points) * 255).astype(int)
    head = (
        "ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\n"
        "property float s\nproperty float t\n{v}element face {m}\n"
        "property list uchar int vertex_indices\n{f}end_header\n"
    )
    rgb = "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
    rows = [f"{x} {y} {z} {x} {y}" for x, y, z in points.tolist()]
    lines = [f"{r} {a} {b} {c}" for r, (a, b, c) in zip(rows, codes.tolist(), strict=True)]
    triangles = ["3 " + " ".join(map(str, f)) for f in faces.tolist()]
    (tmp_path / "v.ply").write_text(
        head.format(n=len(points), m=len(faces), v=rgb, f="") + "\n".join(lines + triangles) + "\n"
    )
    (tmp_path / "f.ply").write_text(
        head.format(n=len(points), m=len(faces), v="", f=rgb)
        + "\n".join(rows + [f"{t} 255 0 51" for t in triangles]) + "\n"
    )  # fmt: skip
    document = read(tmp_path / "v.ply")
    baked = bake_document(document, "vertex-colors", size=32)
    layout = document.uv()
    assert layout is not None
    face, bary = some_places(len(faces), 500)
    truth = np.einsum("pk,pkc->pc", bary, codes[faces[face]] / 255)
    assert np.abs(sample_back(baked, layout, face, bary) - truth).mean() < 3 / 255
    of_faces = bake_document(read(tmp_path / "f.ply"), "vertex-colors", size=8)
    assert (of_faces.tiles[0, 0] == [255, 0, 51]).all()


def test_glb_with_its_image(files: Path):
    new = read(files / "new.obj")
    baked = bake_document(new, "texture", source=read(files / "old.obj"), size=64)
    paths, _ = write_baked(files / "out.glb", baked, new, 0, "texture")
    data = paths[0].read_bytes()
    assert struct.unpack_from("<I", data, 8)[0] == len(data)
    tree, binary = split(data)
    assert tree["buffers"][0]["byteLength"] <= len(binary)
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            material = tree["materials"][primitive["material"]]
            texture = tree["textures"][
                material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
            ]
            view = tree["bufferViews"][tree["images"][texture["source"]]["bufferView"]]
            assert view["byteOffset"] % 4 == 0
            png = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
            assert (np.asarray(Image.open(io.BytesIO(png))) == baked.tiles[0, 0]).all()
    again = read(paths[0])  # and the file can be baked from: its own texture, through its own uv
    layout = again.uv()
    assert layout is not None
    assert len(again.mesh.faces) == len(new.mesh.faces)
    third = bake_document(new, "texture", source=again, size=64)
    assert back(third, files) < 4 / 255


def test_second_uv_set_of_a_glb(files: Path):
    """The old texture through set 0, baked into set 1 of the same file."""
    old, new = read(files / "old.obj"), read(files / "new.obj")
    layout = new.uv()
    before = old.uv()
    assert layout is not None
    assert before is not None
    first = bake_document(new, "texture", source=old, size=64)
    write_baked(files / "one.glb", first, new, 0, "texture")
    one = read(files / "one.glb")
    swapped = UVMap(layout.uv[:, ::-1].copy(), layout.uv_faces[:, :])
    write(files / "two.glb", one, swapped, options=WriteOptions(uv_set=1))
    two = read(files / "two.glb")
    second = bake_document(two, "texture", uv_set=1, size=64)
    given = two.uv(1)
    assert given is not None
    face, bary = some_places(len(two.mesh.faces))
    error = sample_back(second, given, face, bary) - sample_back(first, layout, face, bary)
    assert np.abs(error).mean() < 4 / 255


def test_png_of_several_tiles(tmp_path: Path, files: Path):
    image = np.zeros((4, 4, 3), np.uint8)
    document = read(files / "new.obj")
    baked = Baked({(0, 0): image, (1, 0): image, (0, 1): image}, 1.0)
    paths, _ = write_baked(tmp_path / "a.png", baked, document, 0, "texture")
    assert [p.name for p in paths] == ["a.1001.png", "a.1002.png", "a.1011.png"]
    with pytest.raises(OptionError, match="several tiles"):
        write_baked(tmp_path / "a.glb", baked, document, 0, "texture")


def test_join_and_split_are_inverse():
    tree = {"asset": {"version": "2.0"}, "name": "ü"}
    data = join(tree, b"12345")
    assert len(data) % 4 == 0
    again, binary = split(data)
    assert again == json.loads(json.dumps(tree))
    assert binary[:5] == b"12345"
    with pytest.raises(InputError, match="GLB"):
        split(b"no")
