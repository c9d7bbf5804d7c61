"""Meshes that come from memory: copied, checked, with the uv that came with them."""

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.io import encode
from circparam.formats.materials import decode
from circparam.formats.memory import from_arrays, from_trimesh
from tests.support.formats_tools import grid


def test_arrays_are_copied_and_checked() -> None:
    points, faces = grid(3)
    points = points.astype(float)
    uv = points[:, :2].copy()
    doc = from_arrays(points, faces, uv)
    points[0] = 99
    uv[0] = 99
    assert doc.mesh.points[0].tolist() == [0, 0, 0]
    given = doc.uv()
    assert given.uv[0].tolist() == [0, 0]
    for bad in (uv[:, :1], uv[:3]):
        with pytest.raises(InputError):
            from_arrays(points, faces, bad)
    with pytest.raises(InputError):
        from_arrays(points, faces + 100)


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P", "CMYK", "L"])
@pytest.mark.parametrize("kind", ["simple", "pbr"])
def test_a_texture_of_a_trimesh_object_is_there_to_bake(mode: str, kind: str) -> None:
    import trimesh
    from PIL import Image

    points, faces = grid(3)
    image = Image.new("RGB", (8, 4), (200, 100, 50)).convert(mode)
    materials = trimesh.visual.material
    material = (
        materials.SimpleMaterial(image=image)
        if kind == "simple"
        else materials.PBRMaterial(baseColorTexture=image)
    )
    uv = np.random.default_rng(0).random((9, 2))
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    found = from_trimesh(trimesh.Trimesh(points, faces, process=False, visual=visual)).textures()
    assert found.face.tolist() == [0] * len(faces)
    shown = np.asarray(decode(found.images[0], found.names[0]).convert("RGB"))
    assert shown.shape == (4, 8, 3)
    np.testing.assert_allclose(shown, np.asarray(image.convert("RGB")), atol=2)
    bare = trimesh.visual.TextureVisuals(uv=uv)
    whole = from_trimesh(trimesh.Trimesh(points, faces, process=False, visual=visual))
    assert encode(whole, whole.uv(), "glb").warnings == []
    document = from_trimesh(trimesh.Trimesh(points, faces, process=False, visual=bare))
    assert document.textures() is None
    assert document.textured_sets() == set()


def test_colours_of_a_trimesh_object() -> None:
    import trimesh

    points, faces = grid(3)
    rng = np.random.default_rng(0)
    of_vertex, of_face = (rng.integers(0, 256, (k, 4), np.uint8) for k in (9, len(faces)))
    mesh = trimesh.Trimesh(points, faces, process=False, vertex_colors=of_vertex)
    np.testing.assert_allclose(from_trimesh(mesh).colours(), of_vertex[faces][:, :, :3] / 255)
    mesh = trimesh.Trimesh(points, faces, process=False, face_colors=of_face)
    np.testing.assert_allclose(
        from_trimesh(mesh).colours(), np.repeat(of_face[:, None, :3] / 255, 3, axis=1)
    )
    assert from_trimesh(trimesh.Trimesh(points, faces, process=False)).colours() is None


def test_uv_with_faces_of_their_own() -> None:
    points, faces = grid(2)
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [5, 5]])
    doc = from_arrays(points, faces, uv, [[0, 1, 2], [4, 2, 3]])
    given = doc.uv()
    assert given.uv_faces.tolist() == [[0, 1, 2], [4, 2, 3]]
    assert doc.uv_sets == (0,)
    assert doc.uv(1) is None
    assert from_arrays(points, faces).uv_sets == ()
    assert from_arrays(points, faces).uv() is None
    for wrong, says in (
        ([[0, 1, 2]], "do not fit"),
        ([[0, 1, 2], [3, 4, 5]], "uv_faces name row 5 of 5 uv"),
    ):
        with pytest.raises(InputError, match=says):
            from_arrays(points, faces, uv, wrong)
    with pytest.raises(InputError, match="row 3 of 3"):
        from_arrays(points, faces, uv[:3])  # one row for each vertex is needed
