"""``circparam bake``: files in, files out (tests/cli/test_refusals.py: why there is none)."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.formats.io import read
from circparam.maps.surface_map import save_map
from tests.support.baking import charts, old_and_new, smooth, write_obj
from tests.support.command_line import done, one_line_error, report, run
from tests.support.maps import same_map


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    points, faces = old_and_new(tmp_path, 6, 32)
    layout = charts(points, faces)
    write_obj(tmp_path / "colours.obj", points, layout, faces, colours=smooth(points))
    return tmp_path


def test_texture_of_the_old_file_into_a_glb(folder: Path):
    out = folder / "out.glb"
    words = ("--from", "texture", "--source", folder / "old.obj", "--size", 64, "-o", out)
    got = report("bake", folder / "new.obj", *words)
    assert got["output"] == [str(out)]
    assert 0.3 < got["covered"] < 0.9
    document = read(out)
    assert "textures" in document.features
    assert len(document.mesh.faces) == 72
    one_line_error(run("bake", folder / "new.obj", *words), 2, "--overwrite")
    before = out.read_bytes()
    assert run("bake", folder / "new.obj", *words, "--overwrite", "-q").stdout == ""
    assert out.read_bytes() == before  # the same bytes in every run


def test_shape_of_another_mesh_with_its_figures(folder: Path):
    words = ("--source", folder / "old.obj", "--map", "nearest", "--size", 32, "-o")
    for kind in ("normals", "height"):
        out = folder / f"{kind}.png"
        got = report("bake", folder / "new.obj", "--from", kind, *words, out)
        assert got["cage"] == pytest.approx(0.02 * np.sqrt(2))
        assert (got["map"], got["missed"], got["empty"]) == ("nearest", 0.0, 0.0)
        image = np.asarray(Image.open(out))
        if kind == "normals":
            assert (image == [128, 128, 255]).all()
        else:
            assert got["height_range"] == [-got["cage"], got["cage"]]
            assert image.std() == 0


def test_colours_are_vertex_colours_and_maps_are_read(folder: Path):
    save_map(folder / "m.npz", same_map(read(folder / "new.obj").mesh))
    across = ("--source", folder / "colours.obj", "--map", folder / "m.npz")
    images = []
    for name, kind, words in (
        ("colours.obj", "vertex-colors", ()), ("colours.obj", "colours", ()), ("new.obj", "colours", across),
    ):  # fmt: skip
        out = folder / f"{len(images)}.png"
        result = done("bake", folder / name, "--from", kind, *words, "--size", 64, "-o", out)
        assert result.stdout.strip() == str(out)
        images.append(np.asarray(Image.open(out)).astype(int))
        assert images[-1].shape == (64, 64, 3)
        assert images[-1].std() > 20
        assert np.abs(images[0] - images[-1]).max() <= 1
