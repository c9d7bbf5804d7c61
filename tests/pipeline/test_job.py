"""What all stages share: the repaired surface, and layouts for every face of the file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam import errors
from circparam.core.monitor import Monitor
from circparam.errors import OutOfTimeError
from circparam.formats.io import read_data
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import Mesh
from circparam.pipeline.job import prepare
from circparam.pipeline.options import Options
from circparam.pipeline.unwrap import unwrap
from tests.support import shapes
from tests.support.gltf_files import full_mesh


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
    # the same charts; their numbers follow the faces of each file
    pairs = np.unique(np.stack([one.charts, other.charts[np.argsort(order)]]), axis=1)
    assert pairs.shape[1] == len(np.unique(one.charts)) == len(np.unique(other.charts))
