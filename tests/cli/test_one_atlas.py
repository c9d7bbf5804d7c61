"""``unwrap --one-atlas``: several files on one page, with one set of images; and what is refused."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import circparam
from circparam.core.arrays import FloatArray
from circparam.errors import InputError, OptionError
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.geometry.raster import fragments
from circparam.mesh.mesh import UVMap
from tests.bake.test_rebake import UPRIGHT, looks_alike
from tests.bake.test_rebake_text import shown
from tests.support.baking import sheet, write_obj
from tests.support.command_line import done, one_line_error, report, run
from tests.support.looks import Painted, model, psnr, waves
from tests.support.shapes import areas
from tests.support.validator import validate

SIDE = 512


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """one.glb, two.glb: a painted sheet each, at the same place. three.obj: one with a library, three.ply: one
    without images."""
    out = tmp_path_factory.mktemp("files")
    for seed, name in enumerate(("one", "two")):
        g = Painted()
        image = g.texture(waves(seed, 32))
        material = {"name": name, "pbrMetallicRoughness": {"baseColorTexture": {"index": image}}}
        made = model([material], g, sets=1)
        made.tree["nodes"][0] |= {"name": name, "extras": {"kept": seed}}
        (out / f"{name}.glb").write_bytes(made.glb())
    points, faces = sheet(8)
    layout = UVMap(points[:, :2] * 0.9 + 0.05, faces)
    write_obj(out / "three.obj", points, layout, faces, mtl="three.mtl")
    (out / "three.mtl").write_text("newmtl m\nNs 7\nKd 1 1 1\nmap_Kd three.png\n")
    Image.fromarray(waves(5, 32)).save(out / "three.png")
    circparam.write(out / "four.ply", from_arrays(points, faces), layout)
    return out


ALL = ("one.glb", "two.glb", "three.obj", "four.ply")
TEXTURED = ALL[:3]


def files(folder: Path, names: tuple[str, ...] = ALL) -> list[Path]:
    return [folder / name for name in names]


def corners(path: Path) -> FloatArray:
    """(m, 3, 2) uv of all corners of a file."""
    layout = read(path).uv()
    assert (layout.uv_faces >= 0).all()
    return layout.uv[layout.uv_faces]


def most_on_a_texel(paths: list[Path]) -> int:
    """How many faces of all files have the centre of one texel."""
    xy = np.concatenate([corners(path) for path in paths]) * SIDE
    hits = np.zeros(SIDE * SIDE, np.int64)
    for part in fragments(xy, SIDE, SIDE):
        np.add.at(hits, part.pixel, 1)
    return int(hits.max())


def test_files_share_a_page_at_one_density(folder: Path, tmp_path: Path) -> None:
    """Two of them lie in the same place in space."""
    out = tmp_path / "out"
    got = report("unwrap", *files(folder), "--one-atlas", "--out-dir", out, *UPRIGHT)
    paths = files(out)
    assert most_on_a_texel(paths) == 1
    share = [np.abs(areas(corners(path))).sum() for path in paths]
    meshes = [read(path).mesh for path in paths]
    density = np.array(share) / [areas(mesh.points[mesh.faces]).sum() for mesh in meshes]
    np.testing.assert_allclose(density, density.mean(), rtol=0.01)
    assert got["schema"] == "circparam/atlas/1"
    assert (got["status"], got["overlap"], got["pages"]) == ("ok", 0, 1)
    assert got["charts"] == sum(part["charts"] for part in got["parts"])
    assert [part["output"] for part in got["parts"]] == list(map(str, paths))
    np.testing.assert_allclose([part["packed"] for part in got["parts"]], share, rtol=1e-6)


def test_nothing_of_a_file_is_lost(folder: Path, tmp_path: Path) -> None:
    """All but the uv stays, and images lie beside the outputs that show them."""
    shared = circparam.unwrap_together(files(folder), tmp_path, jobs=1, effort="draft")
    assert [part.output for part in shared.parts] == list(map(str, files(tmp_path)))
    for name in ("one.glb", "two.glb"):
        old, new = read(folder / name), read(tmp_path / name)
        for kind in ("nodes", "scenes", "materials", "textures", "samplers"):
            assert new.tree.json[kind] == old.tree.json[kind]
        np.testing.assert_array_equal(
            new.mesh.points[new.mesh.faces], old.mesh.points[old.mesh.faces]
        )
    old, new = ((place / "three.obj").read_text().splitlines() for place in (folder, tmp_path))
    kept = ("v ", "us", "mt")
    assert [x for x in old if x[:2] in kept] == [x for x in new if x[:2] in kept]
    assert (tmp_path / "three.png").read_bytes() == (folder / "three.png").read_bytes()


def test_pages_are_filled_with_charts_of_all_files(folder: Path, tmp_path: Path) -> None:
    words = ("--pages", 2, "--one-atlas", "--out-dir", tmp_path)
    assert report("unwrap", *files(folder), *words, *UPRIGHT)["pages"] == 2
    page = [np.floor(corners(path).mean(1)[:, 0]) for path in files(tmp_path)]
    assert set(np.concatenate(page).tolist()) == {0.0, 1.0}


def test_one_set_of_images_serves_all_outputs(folder: Path, tmp_path: Path) -> None:
    """A GLB holds it, an OBJ names it; each looks as it did; a file without images goes along."""
    words = ("--rebake", "--size", 256, "--one-atlas", "--out-dir", tmp_path)
    got = report("unwrap", *files(folder), *words, *UPRIGHT)
    assert got["look"]["images"] == ["base_color"]
    assert {p.name for p in tmp_path.iterdir()} == {*ALL, "three.mtl", "atlas_base_color.png"}
    assert "map_Kd atlas_base_color.png" in (tmp_path / "three.mtl").read_text()
    old, new = validate(folder / "one.glb", tmp_path / "one.glb")
    assert new <= old
    for name in ("one.glb", "two.glb"):
        assert min(looks_alike(folder / name, tmp_path / name).values()) >= 40
        document = read(tmp_path / name)
        image = document.tree.view(document.tree.json["images"][0]["bufferView"], "")[0]
        assert bytes(image) == (tmp_path / "atlas_base_color.png").read_bytes()
    count = len(read(folder / "three.obj").mesh.faces)
    before, after = (shown(p / "three.obj", "map_Kd", count) for p in (folder, tmp_path))
    assert psnr(before, after) >= 40
    assert most_on_a_texel(files(tmp_path)) == 1


def test_the_worst_file_decides_over_the_look(folder: Path, tmp_path: Path) -> None:
    words = ("--rebake", "--size", 64, "--padding", 1, "--check-look", "--fail-if", "psnr<98")
    result = run(
        "unwrap", *files(folder)[2:], *words, "--one-atlas", "--out-dir", tmp_path, *UPRIGHT
    )
    assert result.exit_code == 6, result.stderr
    report = json.loads(result.stdout)
    (one,) = report["look"]["check"]["parts"].values()  # the file without images is not drawn
    assert report["psnr"] == one["psnr"] < 98


def test_one_atlas_in_python(folder: Path, tmp_path: Path) -> None:
    names = ["a.gltf", "b.gltf"]
    shared, look = circparam.rebake_together(
        files(folder)[:2], tmp_path, names=names, size=128, padding=1, jobs=1, effort="draft"
    )
    assert (look.size, look.materials) == (128, (2, 2))
    assert shared.result.verification.valid
    written = {*names, "a.bin", "b.bin", "atlas_base_color.png"}
    assert {p.name for p in tmp_path.iterdir()} == written
    again = re.escape(str(tmp_path / "f.glb"))
    for meshes, named, said in (
        ([read(folder / "one.glb").mesh], None, "no name"),
        (files(folder)[:2], ["a.glb"], "1 names for 2 meshes"),
        ([folder / "one.glb"] * 2, ["c.glb", "d.glb"], "named twice"),
        (files(folder)[:2] + files(folder)[3:], ["e.glb", "f.glb", "f.glb"], f"to {again}: rename"),
    ):
        with pytest.raises(OptionError, match=said):
            circparam.unwrap_together(meshes, tmp_path, names=named)
    with pytest.raises(InputError, match="nothing to carry"):
        circparam.rebake_together([folder / "four.ply"], tmp_path)


@pytest.mark.parametrize("spoilt", ["two.glb", "three.png"])
def test_one_bad_file_leaves_no_output(spoilt: str, folder: Path, tmp_path: Path) -> None:
    """A mesh that is cut short, an image that is not there."""
    place, out = tmp_path / "in", tmp_path / "out"
    place.mkdir()
    for path in folder.iterdir():
        if path.is_file():
            (place / path.name).write_bytes(path.read_bytes())
    whole = (place / spoilt).read_bytes()
    os.remove(place / spoilt)
    if spoilt == "two.glb":
        (place / spoilt).write_bytes(whole[:300])
    words = ("--rebake", "--one-atlas", "--out-dir", out)
    one_line_error(run("unwrap", *files(place, TEXTURED), *words), 3)
    assert not out.exists()


def test_files_that_differ_and_have_one_name_are_not_mixed_up(folder: Path, tmp_path: Path) -> None:
    """Two OBJ files of two folders name two images alike."""
    other, out = tmp_path / "other", tmp_path / "out"
    other.mkdir()
    for name in ("three.mtl", "three.png"):
        (other / name).write_bytes((folder / name).read_bytes())
    (other / "five.obj").write_bytes((folder / "three.obj").read_bytes())
    words = ("--one-atlas", "--out-dir", out, *UPRIGHT)
    done("unwrap", folder / "three.obj", other / "five.obj", *words)
    Image.fromarray(waves(9, 32)).save(other / "three.png")
    result = run("unwrap", folder / "three.obj", other / "five.obj", *words, "--overwrite")
    one_line_error(result, 2, "three.png", "differ")
