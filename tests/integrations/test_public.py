"""``circparam.bake``, ``view`` and ``compare`` in Python, results in a notebook, scenes of trimesh."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import circparam
from tests.support import shapes
from tests.support.processes import printed

QUICK = {"effort": 0.02, "jobs": 1}


def test_compare_and_bake_are_called_by_their_names(tmp_path: Path) -> None:
    found = circparam.compare(shapes.grid(5, 5), ["circle", "lscm"], isolate=False)
    assert [row.method for row in found.rows] == ["circle", "lscm"]
    points, faces = shapes.grid(5, 5)
    colours = np.tile([255, 0, 0, 255], (len(points), 1)).astype(np.uint8)
    mesh = trimesh.Trimesh(points, faces, vertex_colors=colours, process=False)
    mesh.export(tmp_path / "m.ply")
    circparam.unwrap(tmp_path / "m.ply", tmp_path / "u.ply", cut="none", **QUICK)
    baked = circparam.bake(tmp_path / "u.ply", "vertex-colors", tmp_path / "c.png", size=64)
    assert 0 < baked.covered <= 1
    assert Image.open(tmp_path / "c.png").size == (64, 64)
    with pytest.raises(circparam.OptionError, match="exists"):
        circparam.bake(tmp_path / "u.ply", "vertex-colors", tmp_path / "c.png", size=64)


def test_every_function_takes_what_unwrap_takes(tmp_path: Path) -> None:
    """inspect wanted a Document, view, bake and map_surfaces a path, and said so by tracebacks."""
    points, faces = shapes.icosphere(1)
    uv = np.random.default_rng(1).random((len(points), 2))
    solid = trimesh.Trimesh(points, faces, process=False)
    dressed = trimesh.Trimesh(
        points, faces, visual=trimesh.visual.TextureVisuals(uv=uv), process=False
    )
    for mesh in (solid, (points, faces), circparam.Mesh(points, faces)):
        assert len(circparam.inspect(mesh).document.mesh.faces) == 80
    assert circparam.inspect(dressed, uv_set=0).uv is not None
    assert circparam.view(dressed, tmp_path / "v.svg").stat().st_size > 0
    there = circparam.map_surfaces(solid, (points, faces), landmarks=[[0, 0], [1, 1], [2, 2]])
    assert there.a_to_b.mean == pytest.approx(1, abs=1e-6)
    laid = circparam.unwrap(solid, tmp_path / "m.obj", **QUICK)
    assert circparam.bake(tmp_path / "m.obj", "normals", source=solid, size=16).covered > 0
    assert len(circparam.transfer(tmp_path / "m.obj", [solid])) == 1
    for wrong in (None, b"bytes", laid):
        with pytest.raises(circparam.InputError, match="is no mesh: give a path, arrays"):
            circparam.inspect(wrong)


def test_objects_are_not_read() -> None:
    for wrong in (trimesh.creation.box(), b"mesh.obj", None):
        with pytest.raises(circparam.InputError, match="is no path of a file"):
            circparam.read(wrong)


def test_one_mesh_in_place_of_a_list(tmp_path: Path) -> None:
    """The letters of its name were taken for files."""
    for call in (
        lambda: circparam.transfer("mesh.obj", "lod.obj"),
        lambda: circparam.unwrap_together("lod.obj", tmp_path),
        lambda: circparam.rebake_together(tmp_path / "lod.obj", tmp_path),
        lambda: circparam.transfer("mesh.obj", trimesh.creation.box()),
    ):
        with pytest.raises(
            circparam.CircparamError, match=r"give a list of meshes|mesh\.obj: no such"
        ):
            call()
    with pytest.raises(circparam.OptionError, match=r"sources .*: give a list of meshes"):
        circparam.unwrap_together("lod.obj", tmp_path)


def test_they_stay_packages_and_functions_whatever_was_imported_first() -> None:
    code = (
        "import circparam.bake.bake, circparam.compare.rows, circparam;"
        "assert callable(circparam.bake) and callable(circparam.compare);"
        "from circparam.bake import bake_document"
    )
    printed(code)


def test_a_result_is_one_line_and_a_picture_in_a_notebook(tmp_path: Path) -> None:
    result = circparam.unwrap(shapes.cube(1), **QUICK)
    assert "\n" not in str(result)
    for word in ("in memory: ok", "chart", "distortion 1", "packed"):
        assert word in str(result)
    page = result._repr_html_()
    assert "<img" in page
    assert "image/svg+xml" in page
    assert circparam.view(result, tmp_path / "v.svg").stat().st_size > 0
    written = circparam.unwrap(shapes.cube(1), tmp_path / "o.obj", **QUICK)
    assert str(written).startswith(str(tmp_path / "o.obj"))
    assert circparam.view(written, tmp_path / "w.svg", up="z").stat().st_size > 0
    with pytest.raises(circparam.OptionError, match="exists"):
        circparam.view(written, tmp_path / "w.svg")


def test_a_scene_keeps_its_nodes_and_instances(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(), geom_name="box", node_name="n0")
    for k in (1, 2):
        move = trimesh.transformations.translation_matrix([3.0 * k, 0, 0])
        scene.graph.update(frame_to=f"n{k}", matrix=move, geometry="box")
    result = circparam.unwrap(scene, tmp_path / "o.glb", **QUICK)
    assert result.status in ("ok", "repaired")
    assert result.document.instances == 2
    again = trimesh.load_scene(tmp_path / "o.glb")
    assert set(again.graph.nodes_geometry) == {"n0", "n1", "n2"}
    assert len(again.geometry) == 1
    np.testing.assert_allclose(again.bounds, scene.bounds, atol=1e-6)
    with pytest.raises(circparam.InputError, match="no faces"):
        circparam.unwrap(trimesh.Scene([trimesh.PointCloud(np.eye(3))]))


def test_a_texture_is_kept_in_the_file_and_told_where_it_is_left_out(tmp_path: Path) -> None:
    points, faces = shapes.grid(4, 4)
    visual = trimesh.visual.TextureVisuals(
        uv=points[:, :2], image=Image.fromarray(np.arange(48, dtype=np.uint8).reshape(4, 4, 3))
    )
    mesh = trimesh.Trimesh(points, faces, visual=visual, process=False)
    result = circparam.unwrap(trimesh.Scene([mesh]), tmp_path / "o.glb", cut="none", **QUICK)
    back = trimesh.load_scene(tmp_path / "o.glb")
    (part,) = back.geometry.values()
    assert part.visual.material.baseColorTexture.size == (4, 4)
    with pytest.warns(UserWarning, match="textures and materials are left out"):
        result.to_trimesh()
