"""Programs of the kind that calls xatlas, written for these tests: they run unchanged but for what they import.

The patterns are those of public pipelines: a single mesh with options out of a configuration (threestudio),
``parametrize`` on a trimesh object (TRELLIS, Hunyuan3D).
"""

import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import circparam.xatlas
from circparam import samples
from tests.support import shapes

PACKAGES = ["xatlas", "circparam"]


@pytest.fixture(params=PACKAGES)
def installed(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """``import xatlas`` gives xatlas itself, or circparam.xatlas in its place."""
    if request.param == "xatlas":
        pytest.importorskip("xatlas", reason="the baseline is not installed")
    else:
        monkeypatch.setitem(sys.modules, "xatlas", circparam.xatlas)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "xatlas' option")  # once by name, which test is first
        yield request.param


@pytest.fixture
def mesh() -> trimesh.Trimesh:
    return trimesh.Trimesh(*shapes.icosphere(2), process=False)


def check(points: Any, faces: Any, vmapping: Any, indices: Any, uvs: Any) -> None:
    """Every corner has its point, every face its place in the unit square, and vertices are used."""
    np.testing.assert_array_equal(np.asarray(points)[vmapping][indices], np.asarray(points)[faces])
    assert uvs.shape == (len(vmapping), 2)
    assert uvs.min() >= 0
    assert uvs.max() <= 1
    assert (shapes.areas(np.asarray(uvs, np.float64)[indices]) != 0).all()


def test_configured_as_threestudio_does(installed: str, mesh: trimesh.Trimesh) -> None:
    """Options come as dictionaries and are set by name; ``get_mesh(0)`` gives int64 indices for a GPU."""
    import xatlas

    atlas = xatlas.Atlas()

    def unwrap_uv(positions: Any, triangles: Any, chart_config: dict, pack_config: dict) -> Any:
        atlas.add_mesh(positions, triangles, mesh.vertex_normals)
        chart_options, pack_options = xatlas.ChartOptions(), xatlas.PackOptions()
        for name, value in chart_config.items():
            setattr(chart_options, name, value)
        for name, value in pack_config.items():
            setattr(pack_options, name, value)
        atlas.generate(chart_options=chart_options, pack_options=pack_options)
        vmapping, indices, uvs = atlas.get_mesh(0)
        return (
            vmapping.astype(np.uint64, casting="same_kind").view(np.int64),
            indices.astype(np.uint64, casting="same_kind").view(np.int64),
            uvs.astype(np.float32),
        )

    points, faces = mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)
    pages = {"padding": 2, "create_image": True, "bruteForce": True}
    out = unwrap_uv(points, faces, {"max_iterations": 2, "normal_seam_weight": 3.0}, pages)
    check(points, faces, *out)
    assert atlas.chart_image.shape == (atlas.height, atlas.width, 3)


def test_a_trimesh_object_as_hunyuan_and_trellis_do(installed: str, tmp_path: Path) -> None:
    """A scene is joined, unwrapped in place and exported; what is read back has the uv."""
    import xatlas

    scene = trimesh.Scene([trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=1)])
    mesh = scene.to_mesh()
    before = mesh.triangles.copy()
    vmapping, indices, uvs = xatlas.parametrize(mesh.vertices, mesh.faces)
    check(mesh.vertices, mesh.faces, vmapping, indices, uvs)
    textured = trimesh.Trimesh(mesh.vertices[vmapping], indices, process=False)
    textured.visual = trimesh.visual.TextureVisuals(uv=uvs)
    np.testing.assert_array_equal(textured.triangles, before)
    xatlas.export(str(tmp_path / "out.obj"), mesh.vertices[vmapping], indices, uvs)
    again = trimesh.load(tmp_path / "out.obj", process=False)
    np.testing.assert_allclose(again.triangles, before, atol=1e-6)
    assert again.visual.uv.shape[1] == 2


def test_what_is_handed_out_has_no_flip_and_fewer_charts_than_xatlas() -> None:
    """Not only the calls: the layouts are those of circparam."""
    theirs = pytest.importorskip("xatlas", reason="the baseline is not installed")
    found = []
    mesh = samples.load("lantern").mesh
    for package in (theirs, circparam.xatlas):
        atlas = package.Atlas()
        atlas.add_mesh(mesh.points, mesh.faces)
        atlas.generate(**({} if package is theirs else {"effort": 0.01}))
        _, indices, uvs = atlas[0]
        flipped = shapes.areas(uvs[indices].astype(np.float64)) < 0
        found.append((atlas.chart_count, int(flipped.sum())))
    assert found[1][0] < found[0][0] / 2
    assert found[0][1] > 0
    assert found[1][1] == 0
