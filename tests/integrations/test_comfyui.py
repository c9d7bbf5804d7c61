"""The nodes for ComfyUI, called as ComfyUI calls them: class, INPUT_TYPES, FUNCTION, RETURN_TYPES."""

import importlib.util
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from circparam._version import __version__
from circparam.errors import InputError
from circparam.formats.io import read
from tests.support import shapes

FOLDER = Path(__file__).parents[2] / "docs" / "integrations" / "comfyui"


@pytest.fixture
def nodes() -> Iterator[dict[str, Any]]:
    """The folder, loaded as ComfyUI loads a folder of custom_nodes."""
    name = "custom_nodes_circparam"
    spec = importlib.util.spec_from_file_location(
        name, FOLDER / "__init__.py", submodule_search_locations=[str(FOLDER)]
    )
    module: ModuleType = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    assert set(module.NODE_CLASS_MAPPINGS) == set(module.NODE_DISPLAY_NAME_MAPPINGS)
    yield module.NODE_CLASS_MAPPINGS
    del sys.modules[name], sys.modules[f"{name}.nodes"]


@pytest.fixture
def quick_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gradient in place of the picture of a layout, which takes seconds."""
    monkeypatch.setattr(
        "circparam.render.picture.save_result",
        lambda path, result, title: Image.linear_gradient("L").save(path),
    )


def run(node: Any, **linked: Any) -> tuple[Any, ...]:
    """Run a node with what is linked to it, and the defaults of its widgets."""
    inputs = node.INPUT_TYPES()
    given = {
        name: kind[1]["default"]
        for name, kind in inputs["required"].items()
        if len(kind) > 1 and "default" in kind[1]
    }
    assert set(linked) <= {*inputs["required"], *inputs.get("optional", {})}
    given |= {"effort": 0.01, "resolution": 256} | linked
    assert set(given) >= set(inputs["required"])
    out = getattr(node(), node.FUNCTION)(**given)
    assert len(out) == len(node.RETURN_TYPES) == len(node.RETURN_NAMES)
    shown = np.asarray(out[1])
    assert shown.ndim == 4
    assert shown.shape[3] == 3
    assert shown.dtype == np.float32
    assert 0 <= shown.min() < shown.max() <= 1
    assert "0 flips, 0 overlaps" in out[2]
    return out


@pytest.mark.usefixtures("quick_pictures")
def test_a_batch_of_meshes(nodes: dict[str, Any]) -> None:
    points, faces = shapes.cube(1)
    mesh = SimpleNamespace(
        vertices=np.stack([points, 3 * points]).astype(np.float32), faces=np.stack([faces, faces])
    )
    out, _, report = run(nodes["CircparamUnwrapMesh"], mesh=mesh)
    assert mesh.vertices.shape == (2, 8, 3)
    assert not hasattr(mesh, "uvs")
    for k in range(2):
        vertices, uv, index = (np.asarray(x)[k] for x in (out.vertices, out.uvs, out.faces))
        np.testing.assert_array_equal(vertices[index], mesh.vertices[k][faces])
        assert (shapes.areas(uv[index].astype(float)) > 0).all()
    assert len(report.splitlines()) == 2


@pytest.mark.usefixtures("quick_pictures")
def test_a_trimesh_object_with_an_image(nodes: dict[str, Any]) -> None:
    mesh = trimesh.Trimesh(*shapes.cube(1), process=False)
    image = np.full((1, 8, 8, 3), 0.5, np.float32)
    node = nodes["CircparamUnwrapTrimesh"]
    out, _, _ = run(node, trimesh=mesh, image=image)
    np.testing.assert_array_equal(out.triangles, mesh.triangles)
    assert out.visual.material.image.size == (8, 8)
    plain, _, _ = run(node, trimesh=mesh, image=None)
    np.testing.assert_array_equal(plain.visual.uv, out.visual.uv)
    none = [np.zeros((8, 8, 3)), np.zeros((1, 8, 8)), np.zeros((0, 8, 8, 3)), "a name", object()]
    for wrong in none:
        with pytest.raises(ValueError, match=r"IMAGE of ComfyUI is \(batch, height, width, 3\)"):
            run(node, trimesh=mesh, image=wrong)


@pytest.mark.usefixtures("quick_pictures")
def test_a_file(nodes: dict[str, Any], tmp_path: Path) -> None:
    trimesh.Trimesh(*shapes.cube(1), process=False).export(tmp_path / "m.glb")
    for output in (str(tmp_path / "other.obj"), ""):
        path, _, _ = run(nodes["CircparamUnwrapFile"], path=str(tmp_path / "m.glb"), output=output)
        assert path == (output or str(tmp_path / "m_uv.glb"))
        assert read(path).uv_sets
    with pytest.raises(InputError, match="no such file"):
        run(nodes["CircparamUnwrapFile"], path=str(tmp_path / "none.glb"))


def test_the_registry_is_told_what_it_needs() -> None:
    told = tomllib.loads((FOLDER / "pyproject.toml").read_text("utf-8"))
    assert told["project"]["version"] == __version__
    assert {"PublisherId", "DisplayName", "Icon"} <= told["tool"]["comfy"].keys()
