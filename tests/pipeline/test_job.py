"""What all stages share: the repaired surface, and layouts for every face of the file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam import errors
from circparam.core.monitor import Monitor
from circparam.errors import OutOfTimeError
from circparam.formats.io import read, read_data
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import Mesh
from circparam.pipeline.job import prepare
from circparam.pipeline.options import Options
from circparam.pipeline.unwrap import unwrap
from tests.support import shapes
from tests.support.gltf_files import full_mesh


def test_faces_set_aside_get_uv_and_numbers_are_those_of_the_format() -> None:
    p, f = shapes.grid(4, 4)
    f = np.r_[f, f[2:3], [[0, 0, 1]]]
    document = from_arrays(p, f)
    for name, exact in (("glb", False), ("obj", True)):
        job = prepare(document, None, Options(format=name), Monitor())
        assert job.target == name
        assert job.tiles is None
        assert len(job.surface.faces) == len(f) - 2
        cut_mesh = job.surface.cut_mesh(np.zeros(len(job.surface.edges), bool))
        uv = np.random.default_rng(0).random((cut_mesh.n_vertices, 2))
        whole = job.completed(cut_mesh, uv)
        assert whole.uv_faces.shape == f.shape
        np.testing.assert_array_equal(whole.uv, uv)
        stored = job.stored(cut_mesh, uv)
        assert np.array_equal(stored.uv, uv) == exact
        np.testing.assert_allclose(stored.uv[stored.uv_faces], uv[whole.uv_faces], atol=1e-6)


@pytest.mark.parametrize(
    ("output", "keywords", "word"),
    [
        ("x.stl", {}, "STL holds no uv.* .obj, .*.glb, .usda, .usdc or .usdz$"),
        ("x.fbx", {}, "FBX holds no uv.* .obj, .*.glb, .usda, .usdc or .usdz$"),
        ("x", {}, "no suffix"),
        ("-", {"format": "stl"}, "no place for uv"),
        ("x.obj", {"lightmap": True}, "a new OBJ file gets one uv set; leave --lightmap out"),
        ("x.obj", {"uv_set": 2}, "leave --uv-set out"),
        ("x.glb", {"lightmap": True}, "uv set 1 exists; replace it with --overwrite-uv"),
        ("x.glb", {"unshare": False, "uv_set": 1}, "uv set 1 exists"),
    ],
)
def test_an_output_without_a_place_for_uv_is_refused_before_the_work(
    tmp_path: Path, output: str, keywords: dict[str, Any], word: str
) -> None:
    scene = full_mesh()
    attributes = scene.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_1"] = attributes["TEXCOORD_0"]
    document = read_data(scene.glb(), format="glb")
    assert document.uv_sets == (0, 1)
    monitor = Monitor()
    target = output if output == "-" else tmp_path / output
    with pytest.raises(errors.OptionError, match=word):
        prepare(document, target, Options(**keywords), monitor)
    assert not monitor.seconds


def test_a_lightmap_of_an_obj_is_refused_by_the_option_that_was_given(tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    document = read(tmp_path / "m.obj")
    with pytest.raises(errors.OptionError, match="OBJ holds one uv set; leave --lightmap out"):
        prepare(document, tmp_path / "o.obj", Options(lightmap=True), Monitor())


def test_a_deadline_and_refused_repairs_end_it_at_once() -> None:
    with pytest.raises(OutOfTimeError, match="--timeout"):
        prepare(from_arrays(*shapes.grid()), None, Options(), Monitor(timeout=-1.0))
    with pytest.raises(errors.TopologyError, match="non-manifold"):
        prepare(from_arrays(*shapes.fins(3)), None, Options(repair=False), Monitor())


@pytest.mark.parametrize("name", ["closed", "polygons", "two sheets"])
def test_the_same_layout_whatever_the_order_of_the_file(name: str) -> None:
    """Faces, corners and vertices shuffled: every corner has the same uv, to the last bit."""
    p, f = (
        shapes.row_of(shapes.bumped_disk(60), 2)
        if name == "two sheets"
        else shapes.noisy(*shapes.cube(3))
    )
    q, g, old, order = shapes.shuffled(p, f, 1)
    polygons = np.arange(len(f)) // 2 if name == "polygons" else None
    options = Options(resolution=256, effort="draft")
    one = unwrap(Mesh(p, f, polygons), options=options)
    other = unwrap(Mesh(q, g, None if polygons is None else polygons[order]), options=options)
    assert one.measures == other.measures
    # the corners of each face by the vertices that they are at
    a, b = (np.argsort(corners, 1)[..., None] for corners in (f[order], old[g]))
    np.testing.assert_array_equal(
        np.take_along_axis(one.uv[one.uv_faces][order], a, 1),
        np.take_along_axis(other.uv[other.uv_faces], b, 1),
    )
    charts = other.charts[np.argsort(order)]
    np.testing.assert_array_equal(one.charts, charts)
