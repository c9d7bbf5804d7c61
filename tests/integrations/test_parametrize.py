"""xatlas' one call: the same code runs with either package, and gets a valid layout."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from PIL import Image

import circparam
from circparam.errors import InputError, OptionError
from circparam.formats.materials import decode
from circparam.formats.memory import from_trimesh
from tests.support import shapes, strategies

xatlas = pytest.importorskip("xatlas", reason="the baseline is not installed")
QUICK = {"effort": 0.01}


def test_shapes_and_types_are_those_of_xatlas() -> None:
    p, f = shapes.cube(3)
    ours, theirs = circparam.parametrize(p, f, **QUICK), xatlas.parametrize(p, f)
    for a, b in zip(ours, theirs, strict=True):
        assert (type(a), a.dtype, a.ndim, a.shape[1:]) == (type(b), b.dtype, b.ndim, b.shape[1:])
    assert len(ours[0]) <= 1.05 * len(theirs[0])


@settings(max_examples=6)
@given(strategies.surfaces())
def test_every_output_is_a_valid_layout_of_the_input(mesh: Any) -> None:
    p, f = mesh
    vmapping, indices, uvs = circparam.parametrize(p, f, **QUICK)
    np.testing.assert_array_equal(vmapping[indices], f)
    assert len(np.unique(np.c_[vmapping, uvs], axis=0)) <= len(vmapping) == len(uvs)
    assert set(np.unique(indices)) == set(range(len(vmapping)))
    assert (np.diff(vmapping.astype(int)) >= 0).all()
    assert uvs.min() >= 0
    assert uvs.max() <= 1


P, F = shapes.cube(1)


@cache
def usual() -> Any:
    """The three arrays of the cube as float64 and int64."""
    return circparam.parametrize(2 * P, F, **QUICK)


@pytest.mark.parametrize(
    ("points", "faces"),
    [("f8", k) for k in (">i4", "<i8", ">u2", "u4", "i1")]
    + [(k, "i8") for k in (">f8", ">f4", "i4", "f2")],
)
def test_numbers_of_every_type_and_in_views(points: str, faces: str) -> None:
    wide = np.repeat(np.asarray(2 * P, points), 2, axis=1)[:, ::2]
    given, before = F.astype(faces)[:, ::-1][:, ::-1], wide.copy()
    for a, b in zip(usual(), circparam.parametrize(wide, given, **QUICK), strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(wide, before)


BAD = {
    "float faces": ((P, F.astype(float)), "integers"),
    "quads": ((P, np.c_[F, F[:, 0]]), "quads"),
    "out of range": ((P, F + 100), "names a vertex outside"),
    "negative": ((P, F - 1), "names a vertex outside"),
    "beyond int64": ((P, F.astype(np.uint64) + np.uint64(2**63)), "fewer vertices"),
    "NaN": ((np.where(P > 0.4, np.nan, P), F), "NaN"),
    "no faces": ((P, np.zeros((0, 3), int)), "no faces"),
    "no points": ((np.zeros((0, 3)), F), "names a vertex outside"),
    "ragged": ((P, [[0, 1, 2], [0, 1]]), "not an array"),
    "words": ((np.full((8, 3), "a"), F), "real numbers"),
    "complex": ((P + 1j, F), "real numbers"),
    "normals": ((P, F, P[:3]), "normal"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arrays_get_one_clear_exception(name: str) -> None:
    arrays, said = BAD[name]
    with pytest.raises(InputError, match=said) as caught:
        circparam.parametrize(*arrays)
    assert "\n" not in str(caught.value)
    assert "--" not in str(caught.value)


def test_options_that_do_not_apply() -> None:
    for name in ("overwrite", "ply_uv", "format", "uv_set"):
        with pytest.raises(OptionError, match=f"{name} concerns files"):
            circparam.parametrize(P, F, **{name: 1})
    for name in ("chart_options", "pack_options"):
        with pytest.raises(OptionError, match=r"circparam\.xatlas\.parametrize takes it"):
            circparam.parametrize(P, F, **{name: None})


def test_a_result_has_the_same_three_arrays() -> None:
    p, f = shapes.icosphere(2)
    result = circparam.unwrap((p, f), **QUICK)
    np.testing.assert_array_equal(result.vmapping[result.indices], f)
    np.testing.assert_array_equal(
        result.uvs[result.indices], result.uv[result.uv_faces].astype(np.float32)
    )
    mesh = result.to_trimesh()
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], p[f])
    np.testing.assert_array_equal(
        np.asarray(mesh.visual.uv, np.float32)[mesh.faces], result.uvs[result.indices]
    )


def test_a_trimesh_object_comes_back_with_its_colours_and_a_baked_texture(tmp_path) -> None:
    """There and back, then through a file: uv, colours and the image that was baked are all there."""
    p, f = shapes.icosphere(2)
    rng = np.random.default_rng(0)
    colours = rng.integers(0, 256, (len(p), 4), np.uint8)
    given = trimesh.Trimesh(p, f, process=False, vertex_colors=colours)
    result = circparam.unwrap(given, **QUICK)
    back = result.to_trimesh(Image.new("RGB", (16, 16), (10, 200, 30)))
    np.testing.assert_array_equal(
        back.visual.vertex_attributes["color"][:, :3], colours[result.vmapping][:, :3]
    )
    back.export(tmp_path / "back.glb")
    again = circparam.read(tmp_path / "back.glb")
    np.testing.assert_array_equal(again.mesh.faces, result.indices)
    image = decode(again.textures().images[0], "image")
    assert image.getpixel((3, 3))[:3] == (10, 200, 30)
    layout = again.uv()
    np.testing.assert_allclose(layout.uv[layout.uv_faces], result.uvs[result.indices], atol=1e-6)
    # colours of faces have no place at vertices that faces share
    of_face = rng.integers(0, 256, (len(f), 4), np.uint8)
    plain = circparam.unwrap(trimesh.Trimesh(p, f, process=False, face_colors=of_face), **QUICK)
    assert "color" not in plain.to_trimesh().visual.vertex_attributes


def test_a_texture_that_does_not_fit_the_new_uv_is_not_shown_and_said(tmp_path) -> None:
    p, f = shapes.bumped_disk(80)
    old = trimesh.visual.TextureVisuals(uv=p[:, :2], image=Image.new("RGB", (4, 4)))
    given = trimesh.Trimesh(p, f, process=False, visual=old)
    result = circparam.unwrap(given, tmp_path / "new.glb", **QUICK)
    assert any("texture" in line for line in result.warnings), result.warnings
    assert from_trimesh(result.to_trimesh()).textures() is None, (
        "trimesh puts four white pixels there"
    )
