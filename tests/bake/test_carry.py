"""Every image of every material in one new layout: what the surface shows stays, map by map."""

from io import BytesIO
from typing import Any

import numpy as np
import pytest
from PIL import Image

from circparam.bake.carry import carry, with_cutoff
from circparam.bake.look_source import Source
from circparam.core.arrays import FloatArray
from circparam.errors import InputError
from circparam.formats.document import WriteOptions
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.io import encode, read_data
from circparam.geometry.shading import frames
from circparam.mesh.mesh import UVMap
from circparam.pipeline.options import LookOptions
from tests.support.looks import (
    Painted,
    bumps,
    image_bytes,
    look_up,
    model,
    psnr,
    seen,
    sheet,
    surface_points,
    texel_levels,
    waves,
)

PLAIN = LookOptions()
MOVED = {"KHR_texture_transform": {"offset": [0.1, 0.3], "rotation": 0.7, "scale": [2.0, 1.5]}}


def page(document: GltfDocument) -> UVMap:
    """A layout of the sheets of ``model`` beside each other, every other one turned by a quarter."""
    points = document.mesh.points
    count = len(document.primitives)
    side = int(np.ceil(np.sqrt(count)))
    uv = np.zeros((len(points), 2))
    for k, p in enumerate(document.primitives):
        pool = document.pools[p.pool]
        part = slice(pool.first, pool.first + pool.count)
        flat = points[part, :2] - points[part, :2].min(0)
        flat = np.stack([flat[:, 1], 1 - flat[:, 0]], 1) if k % 2 else flat
        uv[part] = (np.array([k % side, k // side]) + 0.04 + 0.92 * flat) / side
    return UVMap(uv, document.mesh.faces)


def carried(
    document: GltfDocument,
    size: int = 512,
    uv_set: int = 0,
    look: LookOptions = PLAIN,
    mirrored: bool = False,
) -> GltfDocument:
    """A document after its images went into ``page``, or its mirror image, written and read back."""
    layout = page(document)
    if mirrored:
        layout = UVMap([1, 0] + layout.uv * [-1, 1], layout.uv_faces)
    made, _ = carry(Source.of(document), layout, uv_set, size, look)
    options = WriteOptions(uv_set=uv_set, overwrite_uv=True)
    return read_data(encode(document.dressed(made), layout, "glb", options=options).data)


def read_model(materials: list[dict], g: Painted) -> GltfDocument:
    return read_data(model(materials, g).glb())


def all_maps(g: Painted, seed: int, **other: Any) -> dict[str, Any]:
    """A material that uses every core slot, in two uv sets, moved, repeated, mirrored and clamped."""
    return {
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": g.texture(waves(seed)), "extensions": MOVED},
            "baseColorFactor": [0.9, 0.7, 1.0, 1.0],
            "metallicRoughnessTexture": {"index": g.texture(waves(seed + 1), 33648), "texCoord": 1},
            "metallicFactor": 0.5,
        },
        "occlusionTexture": {"index": g.texture(waves(seed + 2), 33071), "strength": 0.6},
        "emissiveTexture": {"index": g.texture(waves(seed + 3)), "texCoord": 1},
        "emissiveFactor": [0.5, 1.0, 0.2],
        **other,
    }


@pytest.mark.parametrize("merge", ["auto", "none"])
def test_each_map_keeps_40_db(merge: str) -> None:
    """Two materials with all maps and one with factors alone, beside an independent look-up."""
    g = Painted()
    plain = {
        "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.5, 0.1, 1.0], "roughnessFactor": 0.3}
    }
    before = read_model([all_maps(g, 1), all_maps(g, 11), plain], g)
    after = carried(before, look=LookOptions(merge_materials=merge))
    face, bary = surface_points(before)
    old, new = seen(before, face, bary), seen(after, face, bary)
    levels = {name: psnr(old[name], new[name]) for name in old}
    assert min(levels.values()) >= 40, levels
    assert len(after.tree.json["materials"]) == (1 if merge == "auto" else 3)
    assert len(after.tree.json["images"]) == 3  # base colour; occlusion, roughness, metal; emissive


@pytest.mark.parametrize("side", [96, 290])
def test_a_weave_that_is_finer_than_the_page_is_averaged(side: int) -> None:
    """White noise of 1 and of 3 texels along one of the page; each texel shows the mean of what it covers."""
    noise = np.random.default_rng(1).integers(0, 256, (side, side, 3)).astype(np.uint8)
    g = Painted()
    roughness = {"metallicRoughnessTexture": {"index": g.texture(noise)}}
    before = read_model([{"pbrMetallicRoughness": roughness}], g)
    after = carried(before, size=128)
    faces = np.arange(len(before.mesh.faces))
    assert texel_levels(before, after, faces, 128, 1000)["mr"] >= 40


def frames_at(
    document: GltfDocument, uv_set: int, face: np.ndarray, bary: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(p, 3) tangent, bitangent and normal: with the file's tangents, or with those of MikkTSpace."""
    normal, layout, tangent = document.normals(), document.uv(uv_set), document.tangents()
    corners = document.mesh.points[document.mesh.faces]
    if tangent is None:
        made = frames(corners, layout.uv[layout.uv_faces], document.mesh.faces, normal)
        t, sign = made.tangent, made.sign
    else:
        t, sign = tangent[..., :3], tangent[:, 0, 3]
    n, t = ((axis[face] * bary[..., None]).sum(1) for axis in (normal, t))
    n, t = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (n, t))
    return t, sign[face][:, None] * np.cross(n, t), n


def space_normals(document: GltfDocument, face: np.ndarray, bary: FloatArray) -> FloatArray:
    """(p, 3) normals in space as a viewer shades them."""
    info = document.tree.json["materials"][0]["normalTexture"]
    texel = look_up(document, info, face, bary, False)[:, :3] * 2 - 1
    texel[:, :2] *= info.get("scale", 1)
    axes = frames_at(document, info.get("texCoord", 0), face, bary)
    out = sum(texel[:, k : k + 1] * axis for k, axis in enumerate(axes))
    return out / np.linalg.norm(out, axis=1, keepdims=True)


@pytest.mark.parametrize("mirrored", [False, True])
def test_normals_turn_into_the_new_tangents(mirrored: bool) -> None:
    """The second sheet lies turned by a quarter in the new layout, and its old uv were turned before.

    A mirrored layout reverses the bitangent: w is −1.
    """
    g = Painted()
    info = {"index": g.texture(bumps(3)), "texCoord": 1, "scale": 0.8}
    before = read_model([{"normalTexture": info}, {"normalTexture": dict(info)}], g)
    after = carried(before, mirrored=mirrored)
    assert (after.tangents()[..., 3] == (-1 if mirrored else 1)).all()
    face, bary = surface_points(before)
    old, new = space_normals(before, face, bary), space_normals(after, face, bary)
    assert psnr(0.5 + 0.5 * old, 0.5 + 0.5 * new) >= 40
    bent = np.degrees(np.arccos(np.clip((old * new).sum(1), -1, 1)))
    assert np.median(bent) < 0.5


def test_normals_of_the_file_are_told_in_the_tangents_of_the_file() -> None:
    """A file whose TANGENT is not that of its uv: what it shows stays."""
    g = Painted()
    made = model([{"normalTexture": {"index": g.texture(bumps(5))}}], g)
    *_, normal, _ = sheet()
    tangent = np.cross(normal, [0.3, 1.0, 0.2])
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    rows = np.c_[tangent, -np.ones(len(tangent))].astype("f4")
    made.tree["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = g.accessor(rows)
    before = read_data(made.glb())
    after = carried(before)
    face, bary = surface_points(before)
    old, new = space_normals(before, face, bary), space_normals(after, face, bary)
    assert psnr(0.5 + 0.5 * old, 0.5 + 0.5 * new) >= 40


@pytest.mark.parametrize("angle", [None, 0.9])
def test_an_anisotropic_surface_keeps_its_direction(angle: float | None) -> None:
    """Direction in space = texel turned by anisotropyRotation, told in the tangents; None: no texture."""
    g = Painted()
    held: dict[str, Any] = {"anisotropyStrength": 0.5, "anisotropyRotation": 0.6}
    if angle is not None:
        texel = np.round([127.5 * (1 + np.cos(angle)), 127.5 * (1 + np.sin(angle)), 255])
        image = np.broadcast_to(texel.astype(np.uint8), (8, 8, 3))
        held["anisotropyTexture"] = {"index": g.texture(image)}
    colour = {"baseColorTexture": {"index": g.texture(waves(1))}}
    material = {"pbrMetallicRoughness": colour, "extensions": {"KHR_materials_anisotropy": held}}
    before = read_model([material], g)
    after = carried(before)
    new = after.tree.json["materials"][0]["extensions"]["KHR_materials_anisotropy"]
    assert "anisotropyRotation" not in new
    face, bary = surface_points(before, 2000)

    def direction(document: GltfDocument, flat: FloatArray) -> FloatArray:
        t, b, _ = frames_at(document, 0, face, bary)
        out = flat[:, :1] * t + flat[:, 1:] * b
        return out / np.linalg.norm(out, axis=1, keepdims=True)

    texel = look_up(after, new["anisotropyTexture"], face, bary, False)
    turned = 0.6 + (angle or 0.0)
    told = np.tile([np.cos(turned), np.sin(turned)], (len(face), 1))
    cosine = (direction(before, told) * direction(after, texel[:, :2] * 2 - 1)).sum(1)
    assert np.median(cosine) > 0.9999
    assert (cosine > 0.99).mean() > 0.99
    np.testing.assert_allclose(texel[:, 2] * new["anisotropyStrength"], 0.5, atol=0.01)


def test_a_cut_out_keeps_its_edge() -> None:
    """MASK: what is seen before is seen after; materials with other cut-offs get one, and colours behind the
    cut-off do not bleed in."""
    g = Painted()
    materials = []
    for k, cutoff in enumerate((0.3, 0.7)):
        image = waves(20 + k, alpha=True)
        hidden = image[..., 3] < 255 * cutoff
        image[hidden, :3] = 255
        image[~hidden, :3] = 40
        materials.append(
            {
                "pbrMetallicRoughness": {"baseColorTexture": {"index": g.texture(image)}},
                "alphaMode": "MASK",
                "alphaCutoff": cutoff,
            }
        )
    before = read_model(materials, g)
    after = carried(before, 1024)
    assert len(after.tree.json["materials"]) == 1
    face, bary = surface_points(before)
    label = np.repeat([0.3, 0.7], [len(p.triangles) for p in before.primitives])[face]
    shown = seen(before, face, bary)["alpha"][:, 0] >= label
    new = seen(after, face, bary)
    still = new["alpha"][:, 0] >= after.tree.json["materials"][0]["alphaCutoff"]
    assert (shown == still).mean() > 0.99
    clear = shown & still & (seen(before, face, bary)["base"][:, 0] < 42 / 255)
    assert np.percentile(new["base"][clear, 0], 99) < 60 / 255


@pytest.mark.parametrize(
    ("own", "common"), [(0.3, 0.7), (0.7, 0.3), (0.5, 0.5), (0.0, 0.5), (0.5, 1.0)]
)
def test_an_edge_moves_to_the_common_cut_off_and_both_ends_stay(own: float, common: float) -> None:
    """Cut-offs at an end have no room on one side: there alpha stays."""
    alpha = np.linspace(0, 1, 101)
    out = with_cutoff(alpha, own, common)
    assert (np.diff(out) > 0).all()
    np.testing.assert_allclose(out[[0, -1]], [0, 1], atol=1e-12)
    inner = 0 < own < 1 and 0 < common < 1
    np.testing.assert_allclose(np.interp(own, alpha, out), common if inner else own)


@pytest.mark.parametrize("mode", ["MASK", "BLEND"])
def test_what_is_not_seen_gives_no_colour(mode: str) -> None:
    """A texel over pixels some of which are not seen has the colour of the others."""
    g = Painted()
    rng = np.random.default_rng(2)
    image = np.full((64, 64, 4), 40, np.uint8)
    hidden = rng.random((64, 64)) < 0.4
    image[..., 3] = 255
    image[hidden] = [255, 255, 255, 0]
    texture = {"index": g.texture(image, magFilter=9728)}
    material = {"pbrMetallicRoughness": {"baseColorTexture": texture}, "alphaMode": mode}
    before = read_model([material, dict(material)], g)
    made, _ = carry(Source.of(before), page(before), 0, 128, PLAIN)
    out = np.asarray(Image.open(BytesIO(made.pages["base_color"])))
    some = (out[..., 3] > 0) & (out[..., 3] < 255)
    assert some.mean() > 0.2
    assert (out[some, 0] == 40).all()


def test_materials_that_differ_in_more_stay_apart() -> None:
    g = Painted()
    colour = {"pbrMetallicRoughness": {"baseColorTexture": {"index": g.texture(waves(1))}}}
    different: list[dict[str, Any]] = [
        colour,
        colour | {"doubleSided": True},
        colour | {"alphaMode": "BLEND"},
        colour | {"extensions": {"KHR_materials_ior": {"ior": 1.2}}},
        colour | {"name": "another name"},
    ]
    after = carried(read_model(different, g), 128)
    assert len(after.tree.json["materials"]) == 4
    assert len(after.tree.json["images"]) == 1


def test_faces_without_uv_take_the_factor() -> None:
    g = Painted()
    pbr = {
        "baseColorTexture": {"index": g.texture(waves(1))},
        "baseColorFactor": [0.5, 0.2, 0.9, 1],
    }
    made = model([{"pbrMetallicRoughness": pbr}, {"pbrMetallicRoughness": dict(pbr)}], g)
    for number in (0, 1):
        del made.tree["meshes"][1]["primitives"][0]["attributes"][f"TEXCOORD_{number}"]
    before = read_data(made.glb())
    after = carried(before, 256)
    face, bary = surface_points(after)
    bare = face >= len(before.primitives[0].triangles)
    base = seen(after, face[bare], bary[bare])["base"]
    factor = np.array([0.735357, 0.484529, 0.954687])  # 0.5, 0.2, 0.9 coded as sRGB
    np.testing.assert_allclose(base, np.tile(factor, (len(base), 1)), atol=0.005)


def test_sixteen_bits_of_grey() -> None:
    """Pillow clips 16 bits to 8 where it is not told better."""
    g = Painted()
    grey = (waves(2)[..., 0].astype(np.uint16)) * 257
    material = {"occlusionTexture": {"index": g.texture(image_bytes(grey))}}
    before = read_model([material], g)
    after = carried(before)
    face, bary = surface_points(before)
    texture = {"index": g.texture(waves(2)[..., :1].repeat(3, 2))}
    plain = read_model([{"occlusionTexture": texture}], g)
    old, new = (seen(d, face, bary)["occlusion"] for d in (plain, after))
    assert psnr(old, new) >= 40


def test_the_whole_page_is_filled() -> None:
    """No texel keeps a background: halving the page any number of times takes in the charts' colours alone."""
    g = Painted()
    red = np.tile(np.uint8([200, 30, 40]), (8, 8, 1))
    colour = {"baseColorTexture": {"index": g.texture(red)}}
    before = read_model([{"pbrMetallicRoughness": colour}], g)
    made, texels = carry(Source.of(before), page(before), 0, 64, PLAIN)
    image = np.asarray(Image.open(BytesIO(made.pages["base_color"])))
    assert texels.covered < 64 * 64
    assert (image == [200, 30, 40]).all()


def test_broken_images_and_uv_are_named_before_the_work() -> None:
    g = Painted()
    for data, says in (
        (b"", "0 bytes"),
        (b"\x89PNG no", "no known format"),
        (b"\xabKTX 20\xbb", "KTX2"),
    ):
        broken = Painted()
        info = {"index": broken.texture(data or b"x")}
        if not data:
            broken.tree["bufferViews"][-1]["byteLength"] = 0
        document = read_model([{"emissiveTexture": info}], broken)
        with pytest.raises(InputError, match=says) as caught:
            Source.of(document)
        assert "\n" not in str(caught.value)
    made = model([{"emissiveTexture": {"index": g.texture(waves(1))}}], g)
    uv = np.full((81, 2), np.nan, "f4")
    made.tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = g.accessor(uv)
    document = read_data(made.glb())
    with pytest.raises(InputError, match="NaN"):
        Source.of(document)


def test_a_texture_that_is_not_known_is_named() -> None:
    g = Painted()
    odd = {"VENDOR_paint": {"sparkleTexture": {"index": g.texture(waves(1))}}}
    with pytest.raises(InputError, match="sparkleTexture"):
        Source.of(read_model([{"extensions": odd}], g))
