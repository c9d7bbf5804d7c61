"""One surface's looks and shape on another: along rays, and through maps that are known."""

from pathlib import Path

import numpy as np
import pytest

from circparam.bake.bake import Across, Baked, bake_document
from circparam.bake.projection import own_frames
from circparam.core.arrays import FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.gltf.morphing import with_frames
from circparam.formats.io import encode, read, read_data
from circparam.formats.source import Source
from circparam.geometry.shading import corner_normals, unit
from circparam.maps.surface_map import Places, SurfaceMap, fingerprint
from circparam.mesh.mesh import Mesh, UVMap
from circparam.render.texture import bilinear
from tests.support.baking import noise, sample_back, sheet, some_places, stored, write_obj
from tests.support.bumps import belt, traced
from tests.support.looks import psnr
from tests.support.maps import known_map, same_map
from tests.support.shapes import normals

NEAREST = Across("nearest", 0.06)


def level(points: FloatArray, faces: IntArray) -> tuple[Mesh, UVMap]:
    """A mesh laid out as it is seen from above."""
    return Mesh(points, faces), UVMap(points[:, :2].copy(), faces)


def decoded(baked: Baked, document: Document, face: IntArray, bary: FloatArray) -> FloatArray:
    """Directions in space that a viewer of glTF reads from a normal map."""
    layout = document.uv()
    x, y, z = (2 * sample_back(baked, layout, face, bary) - 1).T[..., None]
    space = own_frames(document, layout.corners)
    t, b, n = (
        unit(np.einsum("pk,pkc->pc", bary, axis[face]))
        for axis in (space.tangent, space.bitangent, space.normal)
    )
    return unit(x * t + y * b + z * n)


def angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Degrees between unit vectors."""
    return np.degrees(np.arccos(np.clip((a * b).sum(1), -1, 1)))


def test_normals_of_a_dense_mesh_as_a_ray_tracer_sees_them(tmp_path: Path):
    """Mean angular error below 2° where the cage holds (asked for); the low mesh itself is off by 7°."""
    low, high = belt(16, 32), belt(80, 160, 0.02, 1.0)
    target, source = stored(tmp_path, "low", *low), stored(tmp_path, "high", *high)
    baked = bake_document(target, "normals", source=source, across=NEAREST, size=256)
    face, bary = some_places(len(low[0].faces), 200)
    corners = low[0].points[low[0].faces]
    normal = corner_normals(corners, low[0].faces)
    seam = np.abs(np.einsum("pk,pkc->pc", bary, corners[face])[:, 1]) < 0.05
    direction = unit(np.einsum("pk,pkc->pc", bary, normal[face]))
    hit, _ = traced(high[0], np.einsum("pk,pkc->pc", bary, corners[face]), direction, 0.06)
    on = (hit >= 0) & ~seam
    assert on.mean() > 0.9
    truth = normals(high[0].points[high[0].faces])[hit[on]]
    error = angle(decoded(baked, target, face[on], bary[on]), truth)
    assert error.mean() < 1.5
    assert angle(direction[on], truth).mean() > 5
    assert 0 <= baked.report["missed"] < 0.02
    assert baked.report["cage"] == 0.06


def test_a_slope_that_looks_up_is_green(tmp_path: Path):
    """Red towards growing u, green towards growing v, on mirrored uv too."""
    points, faces = sheet(4)
    slope = points.copy()
    slope[:, 2] = -0.5 * points[:, 1] - 0.25 * points[:, 0]
    source = stored(tmp_path, "slope", *level(slope, faces))
    wanted = np.array([0.25, 0.5, 1.0]) / np.linalg.norm([0.25, 0.5, 1.0])
    for sign in (1, -1):
        uv = points[:, :2] * [sign, 1] + [sign == -1, 0]
        flat = stored(tmp_path, f"flat{sign}", Mesh(points, faces), UVMap(uv, faces))
        across = Across("nearest", 2.0)
        image = bake_document(flat, "normals", source=source, across=across, size=16).tiles[0, 0]
        assert np.abs(image / 127.5 - 1 - wanted * [sign, 1, 1]).max() < 0.02


def test_heights_are_those_of_the_bumps(tmp_path: Path):
    low, high = belt(60, 120), belt(60, 120, 0.02)
    target, source = stored(tmp_path, "low", *low), stored(tmp_path, "high", *high)
    baked = bake_document(target, "height", source=source, across=NEAREST, size=256)
    image = baked.tiles[0, 0]
    assert image.dtype == np.uint16
    bottom, top = baked.report["height_range"]
    assert (bottom, top) == (-0.06, 0.06)
    mapped = Across(known_map(target.mesh, source.mesh))
    own = bake_document(target, "height", source=source, across=mapped, size=64)
    low_end, high_end = own.report["height_range"]
    assert -low_end == high_end
    assert 0 < high_end < 0.02, "a map leads to the bumps, and leaves what lies between vertices"
    face, bary = some_places(len(low[0].faces), 1000)
    grey = bilinear(image / 65535, np.einsum("pk,pkc->pc", bary, low[1].uv[low[1].uv_faces[face]]))
    height = bottom + (top - bottom) * grey[:, 0]
    inner = (low[1].uv[low[1].uv_faces[face]].mean(1)[:, 1] > 0.23) & (
        low[1].uv[low[1].uv_faces[face]].mean(1)[:, 1] < 0.67
    )
    place = np.einsum("pk,pkc->pc", bary, low[0].points[low[0].faces[face]])
    there = np.einsum("pk,pkc->pc", bary, high[0].points[high[0].faces[face]])
    truth = np.linalg.norm(there, axis=1) - np.linalg.norm(place, axis=1)
    assert np.abs(height - truth)[inner].max() < 0.004
    assert np.corrcoef(height[inner], truth[inner])[0, 1] > 0.99


@pytest.mark.parametrize("by", ["nearest", "map", "turned map"])
def test_a_texture_on_a_remeshing_of_its_mesh(tmp_path: Path, by: str):
    """30 dB and more between the two textures, at equal places of the surface (asked for)."""
    a, b = belt(30, 60), belt(36, 70, 0.0, 1.0)
    image = noise(tmp_path / "skin.png")
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd skin.png\n")
    source = stored(tmp_path, "b", *b, mtl="m.mtl")
    target = stored(tmp_path, "a", *a)
    mapped = known_map(target.mesh, source.mesh)
    across = {
        "nearest": NEAREST, "map": Across(mapped), "turned map": Across(mapped.turned()),
    }[by]  # fmt: skip
    baked = bake_document(target, "texture", source=source, across=across, size=384)
    face, bary = some_places(len(a[0].faces), 10000)
    uv = np.einsum("pk,pkc->pc", bary, a[1].uv[a[1].uv_faces[face]])
    inner = ((uv > [0.07, 0.22]) & (uv < [0.93, 0.68])).all(1)
    # uv are the surface's own parameters on both meshes, so the two pictures are one
    seen = sample_back(baked, a[1], face[inner], bary[inner])
    assert psnr(seen, bilinear(image, uv[inner])) >= 30


def test_normals_through_a_map_turn_with_the_surface(tmp_path: Path):
    """A target that lies turned over in space gets the same map of normals as one that lies in place."""
    low, high = belt(16, 32), belt(30, 60, 0.02, 1.0)
    source = stored(tmp_path, "high", *high)
    here = stored(tmp_path, "here", *low)
    turned = low[0].points @ np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]) * 2
    there = stored(tmp_path, "there", Mesh(turned, low[0].faces), low[1])
    across = Across(known_map(here.mesh, source.mesh))
    one, two = (
        bake_document(target, "normals", source=source, across=across, size=128).tiles[0, 0]
        for target in (here, there)
    )
    assert (one == two).all()
    assert np.abs(one.astype(float) - [127.5, 127.5, 255]).max() > 20


def test_what_rays_miss_is_told_filled_or_left(tmp_path: Path):
    """A source that covers half of the target: beyond it the closest point, then the padding."""
    points, faces = sheet(8)
    target = stored(tmp_path, "a", *level(points, faces))
    half = faces[points[faces][..., 0].max(1) <= 0.5]
    source = stored(tmp_path, "b", *level(points, half))
    across = Across("nearest", 0.1)
    baked = bake_document(target, "normals", source=source, across=across, size=80)
    assert baked.report["missed"] == pytest.approx(0.5, abs=0.01)
    assert baked.report["empty"] == pytest.approx(0.3, abs=0.01)  # two cages are filled
    assert any("50 % of the rays" in note for note in baked.notes)
    assert (baked.tiles[0, 0] == [128, 128, 255]).all()  # no black


def test_heights_beside_the_source_go_on_as_they_end(tmp_path: Path):
    """Where rays miss, the closest point tells the height: above the target is brighter than the middle."""
    points, faces = sheet(8)
    target = stored(tmp_path, "a", *level(points, faces))
    half = faces[points[faces][..., 0].max(1) <= 0.5]
    for height in (0.05, -0.05):
        source = stored(tmp_path, f"b{height}", *level(points + np.array([0, 0, height]), half))
        baked = bake_document(
            target, "height", source=source, across=Across("nearest", 0.1), size=64
        )
        assert baked.report["missed"] - baked.report["empty"] > 0.1
        wanted = 65535 * (0.5 + 0.5 * height / 0.1)
        np.testing.assert_allclose(baked.tiles[0, 0].astype(float), wanted, atol=0.01 * 65535)


def test_surfaces_apart_or_mirrored_are_refused(tmp_path: Path):
    points, faces = sheet(4)
    target = stored(tmp_path, "a", *level(points, faces))
    far = stored(tmp_path, "far", *level(points + np.array([0, 0, 9.0]), faces))
    over = stored(tmp_path, "over", *level(points, faces[:, ::-1]))
    heard: list[str] = []
    monitor = Monitor(lambda stage, fraction, note: heard.append(stage))
    for source in (far, over):
        given = {"source": source, "across": Across("nearest"), "size": 16, "monitor": monitor}
        with pytest.raises(InputError, match="no ray meets the source"):
            bake_document(target, "normals", **given)
        assert "bake" not in heard, "told before the rays of all texels"
    across = Across(known_map(target.mesh, over.mesh))
    with pytest.raises(InputError, match="mirrored"):
        bake_document(target, "normals", source=over, across=across, size=16)


def test_a_map_of_another_mesh_is_refused(tmp_path: Path):
    a, b = (stored(tmp_path, name, *level(*sheet(n))) for name, n in (("a", 3), ("b", 4)))
    own = Across(known_map(a.mesh, a.mesh))
    for target, source in ((a, b), (b, a)):
        with pytest.raises(InputError, match=r"b\.obj: the map was made for another mesh"):
            bake_document(target, "normals", source=source, across=own, size=16)


def test_a_map_tells_between_layers(tmp_path: Path):
    """Two sheets, one a little above the other: the target belongs to the lower one, and sees it alone."""
    points, faces = sheet(4)
    n = len(points)
    both = np.concatenate([points, points + np.array([0, 0, 0.05])])
    colours = np.concatenate([np.tile([1.0, 0, 0], (n, 1)), np.tile([0, 0, 1.0], (n, 1))])
    two = np.concatenate([faces, faces + n])
    layout = UVMap(both[:, :2].copy(), two)
    write_obj(tmp_path / "two.obj", both, layout, two, colours=colours)
    source = read(tmp_path / "two.obj")
    target = stored(tmp_path, "one", *level(points, faces))
    down = same_map(target.mesh)
    up = Places(np.tile(down.to_a.face, 2), np.tile(down.to_a.weights, (2, 1)))
    mapped = SurfaceMap(down.to_b, up, down.a, fingerprint(source.mesh))
    image = bake_document(
        target, "vertex-colors", source=source, across=Across(mapped), size=32
    ).tiles[0, 0]
    assert (image == [255, 0, 0]).all()
    rays = Across("nearest", 0.1)  # rays from above see the upper one
    image = bake_document(target, "vertex-colors", source=source, across=rays, size=32)
    assert (image.tiles[0, 0] == [0, 0, 255]).all()


def test_normals_of_a_file_are_those_that_it_is_shaded_with(tmp_path: Path):
    """A flat glTF whose NORMAL lean: what its viewer decodes is still the flat source."""
    points, faces = sheet(4)
    layout = UVMap(points[:, :2].copy(), faces)
    plain = stored(tmp_path, "a", Mesh(points, faces), layout)
    lean = np.broadcast_to(unit(np.array([0.3, -0.2, 1.0])), (len(faces), 3, 3))
    tangent = np.broadcast_to([1.0, 0, 0, 1], (len(faces), 3, 4))
    glb = encode(plain, layout, "glb").data
    target = read_data(with_frames(glb, Source("lean.glb"), lean, tangent))
    baked = bake_document(target, "normals", source=plain, across=Across("nearest", 0.1), size=64)
    face, bary = some_places(len(faces), 200)
    assert angle(decoded(baked, target, face, bary), np.tile([0, 0, 1.0], (200, 1))).max() < 1
    assert np.abs(baked.tiles[0, 0][..., :2].astype(int) - 128).min() > 10


def test_faces_at_one_place_of_the_page_have_frames_of_their_own(tmp_path: Path):
    """A triangle and one turned by a quarter with the same uv: each tangent runs along u of its own face."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 0, 0], [5, 1, 0], [4, 0, 0.0]])
    faces = np.arange(6).reshape(2, 3)
    target = stored(tmp_path, "a", Mesh(points, faces), UVMap(points[:3, :2], faces % 3))
    along_u = (points[faces[:, 1]] - points[faces[:, 0]])[:, None]
    tangent = own_frames(target, target.uv().corners).tangent
    np.testing.assert_allclose(tangent, np.broadcast_to(along_u, tangent.shape), atol=1e-12)


def test_sources_without_area_or_beyond_any_double_are_named(tmp_path: Path):
    points, faces = sheet(3)
    layout = UVMap(points[:, :2].copy(), faces)
    target = stored(tmp_path, "a", Mesh(points, faces), layout)
    for scale, says in ((1e300, "1e\\+300 units"), (1e-200, "1e-200 units")):
        source = stored(tmp_path, "odd", Mesh(points * scale, faces), layout)
        with pytest.raises(InputError, match=rf"odd.obj: it is {says}"):
            bake_document(target, "normals", source=source, across=NEAREST, size=16)
    for place in ([1, 0, 0], [0, 0, 0]):
        line = stored(tmp_path, "line", Mesh(points * place, faces), layout)
        with pytest.raises(InputError, match=r"line.obj: none of its faces has an area"):
            bake_document(target, "height", source=line, across=NEAREST, size=16)
