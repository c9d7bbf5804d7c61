"""``circparam morph``: files in, a GLB out, and every reason why there is none."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from circparam.cli import cli
from circparam.formats.io import read
from circparam.maps.surface_map import save_map
from tests.support.baking import write_obj
from tests.support.bumps import belt
from tests.support.maps import known_map, same_map


def run(*words: object) -> Result:
    return CliRunner().invoke(cli, ["morph", *map(str, words)])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    meshes = []
    for name, size, bump in (("a", 6, 0.0), ("b", 9, 0.05)):
        mesh, layout = belt(size, 2 * size, bump)
        write_obj(tmp_path / f"{name}.obj", mesh.points, layout, mesh.faces)
        meshes.append(read(tmp_path / f"{name}.obj").mesh)
    save_map(tmp_path / "m.npz", known_map(*meshes))
    save_map(tmp_path / "other.npz", same_map(meshes[0]))
    return tmp_path


def test_a_morph_and_its_figures(folder: Path):
    out = folder / "out.glb"
    words = (folder / "a.obj", folder / "b.obj", "--map", folder / "m.npz", "-o", out)
    result = run(*words)
    assert result.exit_code == 0, result.stderr
    assert result.stdout.strip() == str(out)
    first = out.read_bytes()
    again = run(*words)
    assert (again.exit_code, out.read_bytes()) == (2, first)
    assert "--overwrite" in again.stderr
    result = run(*words, "--overwrite", "--json", "--frames", 4)
    report = json.loads(result.stdout)
    assert (report["schema"], report["frames"]) == ("circparam/morph/1", 4)
    assert report["faces"] == 144
    assert report["reversed"] == 0
    assert 0 < report["moved_mean"] < report["moved_max"] < 0.1
    assert len(out.read_bytes()) < len(first)  # fewer key frames
    assert "morph targets" in read(out).features
    assert np.isfinite(read(out).mesh.points).all()


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("a.obj", "b.obj", "--map", "gone.npz"), 3, "gone.npz"),
        (("a.obj", "b.obj", "--map", "a.obj"), 3, "not a map between surfaces"),
        (("a.obj", "b.obj", "--map", "other.npz"), 3, "made for another mesh"),
        (("a.obj", "gone.obj", "--map", "m.npz"), 3, "no such file"),
        (("a.obj", "b.obj", "--map", "m.npz", "--frames", "1"), 2, "--frames 1"),
        (("a.obj", "b.obj"), 2, "--map"),
    ],
)
def test_what_is_refused(folder: Path, words: tuple[str, ...], code: int, message: str):
    out = folder / "out.glb"
    result = run(*(folder / w if "." in w else w for w in words), "-o", out)
    assert result.exit_code == code
    assert message in result.stderr
    assert not out.exists()


def test_other_formats_have_no_place_for_it(folder: Path):
    out = folder / "out.obj"
    result = run(folder / "a.obj", folder / "b.obj", "--map", folder / "m.npz", "-o", out)
    assert result.exit_code == 2
    assert ".glb" in result.stderr
    assert not out.exists()
