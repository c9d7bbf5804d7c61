"""``unwrap --rebake`` and ``bake --all``: files whose textures go along, and what is refused."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, OptionError
from circparam.formats.io import read
from tests.bake.test_carry import all_maps
from tests.support.command_line import done, report, run
from tests.support.gltf_files import unused_entries
from tests.support.looks import Painted, bumps, model, psnr, seen, surface_points, waves
from tests.support.shapes import areas
from tests.support.validator import validate

FAST = ("--effort", "0.02", "-j", "1", "--json")
# packing moves charts that are turned by small steps for seconds
UPRIGHT = ("--rotate", "none", *FAST)


@pytest.fixture(scope="module")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """model.glb: two materials with all core maps, one with normals too; names, extras, an animation.
    plain.glb: the same, unwrapped without its images."""
    folder = tmp_path_factory.mktemp("painted")
    g = Painted()
    first = all_maps(g, 1, name="first", extras={"kept": 1})
    second = all_maps(g, 11, name="second", extras={"kept": 1})
    second["normalTexture"] = {"index": g.texture(bumps(3))}
    made = model([first, second], g)
    made.tree["nodes"][0] |= {"name": "left", "extras": {"a": [1]}}
    times, turns = np.float32([0, 1]), np.float32([[0, 0, 0], [1, 0, 0]])
    sampler = {"input": g.accessor(times, min=[0.0], max=[1.0]), "output": g.accessor(turns)}
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    made.tree["animations"] = [{"channels": [channel], "samplers": [sampler]}]
    made.tree["extensionsUsed"] = ["KHR_texture_transform"]
    (folder / "model.glb").write_bytes(made.glb())
    words = ("-o", folder / "plain.glb", *FAST)
    assert run("unwrap", folder / "model.glb", *words).exit_code == 0
    return folder


@pytest.fixture
def painted(made_once: Path, tmp_path: Path) -> Path:
    """A folder with the files of ``made_once``."""
    for path in made_once.iterdir():
        shutil.copy(path, tmp_path)
    return tmp_path


def looks_alike(old: Path, new: Path) -> dict[str, float]:
    """PSNR of each map at points of the surface of two files with the same faces."""
    before, after = read(old), read(new)
    face, bary = surface_points(before)
    a, b = seen(before, face, bary), seen(after, face, bary)
    return {name: psnr(a[name], b[name]) for name in a}


def test_a_model_keeps_its_look_in_its_new_uv(painted: Path) -> None:
    out = painted / "new.glb"
    told = report("unwrap", painted / "model.glb", "--rebake", "-o", out, *FAST)
    assert told["flips"] == 0
    assert told["overlap"] == 0
    look = told["look"]
    assert look["materials_before"] == 2
    assert look["materials"] == 1
    assert look["images"] == ["base_color", "emissive", "normal", "orm"]
    assert min(looks_alike(painted / "model.glb", out).values()) >= 40
    old, new = read(painted / "model.glb"), read(out)
    for kind in ("nodes", "scenes"):
        assert new.tree.json[kind] == old.tree.json[kind]
    assert len(new.tree.json["animations"]) == 1
    assert new.tree.json["materials"][0]["extras"] == {"kept": 1}
    assert "extensionsUsed" not in new.tree.json
    assert unused_entries(new.tree.json) == (set(), set())
    assert "TEXCOORD_1" in new.pools[0].attributes
    assert validate(painted / "model.glb", out)[1] <= validate(painted / "model.glb")[0]


def test_rebake_in_python(painted: Path) -> None:
    """Options of both kinds by name; a bake of one image leaves none behind there either."""
    out = painted / "new.glb"
    result, look = circparam.rebake(
        painted / "model.glb", out, size=256, merge_materials="none", jobs=1, effort=0.02
    )
    assert result.path == str(out)
    assert (look.size, look.materials) == (256, (2, 2))
    with pytest.raises(InputError, match="bake --all"):
        circparam.bake(
            painted / "plain.glb", "texture", painted / "b.glb", source=painted / "model.glb"
        )
    with pytest.raises(OptionError, match="sise"):
        circparam.rebake(painted / "model.glb", painted / "c.glb", sise=3)


def test_a_look_that_is_lost_is_told(painted: Path) -> None:
    """16 texels for the whole model: the gate holds, and the file is there to look at."""
    out = painted / "new.glb"
    g = Painted()
    colour = {"baseColorTexture": {"index": g.texture(waves(1))}}
    (painted / "one.glb").write_bytes(model([{"pbrMetallicRoughness": colour}], g).glb())
    words = ("--rebake", "--size", 16, "--padding", 1, "--check-look", "--fail-if", "psnr<38")
    result = run("unwrap", painted / "one.glb", *words, "-o", out, *UPRIGHT[:-1])
    assert result.exit_code == 6, result.stderr
    assert "psnr<38" in result.stderr
    assert out.exists()
    words = ("--size", 16, "--check-look", "-o", painted / "again.glb")
    baked = run("bake", out, "--all", "--source", painted / "one.glb", *words)
    for told in (result, baked):
        assert "PSNR" in told.stdout, "who asks for the figures reads them"


def test_gltf_keeps_its_images_beside_it(painted: Path) -> None:
    out = painted / "sub" / "new.gltf"
    out.parent.mkdir()
    done("unwrap", painted / "model.glb", "--rebake", "--size", 512, "-o", out, *FAST)
    names = sorted(p.name for p in out.parent.iterdir() if p.suffix == ".png")
    assert names == [f"new_{page}.png" for page in ("base_color", "emissive", "normal", "orm")]
    tree = json.loads(out.read_text())
    assert sorted(image["uri"] for image in tree["images"]) == names
    assert validate(out)[0] <= validate(painted / "model.glb")[0]


def test_a_new_buffer_may_have_the_name_of_the_old_one(painted: Path) -> None:
    """A glTF whose buffer nothing uses any more, written under its own name into another folder."""
    first, second = painted / "first", painted / "second"
    for folder, source in ((first, painted / "model.glb"), (second, first / "model.gltf")):
        folder.mkdir()
        rebake = ("--rebake", "--size", 64, "--padding", 1) if folder == second else ()
        done("unwrap", source, *rebake, "-o", folder / "model.gltf", *FAST)
    assert {p.suffix for p in second.iterdir()} == {".gltf", ".bin", ".png"}
    old, new = read(first / "model.gltf"), read(second / "model.gltf")
    np.testing.assert_array_equal(old.mesh.points[old.mesh.faces], new.mesh.points[new.mesh.faces])


def test_bake_all_takes_the_layout_of_another_file(painted: Path) -> None:
    plain, out = painted / "plain.glb", painted / "new.glb"
    words = ("--all", "--source", painted / "model.glb", "-o", out, "--json")
    assert report("bake", plain, *words)["materials"] == 1
    assert min(looks_alike(painted / "model.glb", out).values()) >= 40


def test_images_move_to_another_set_of_the_same_file(painted: Path) -> None:
    """A second set as --lightmap writes it; then the images move there, and the first set stays."""
    both, out = painted / "both.glb", painted / "new.glb"
    words = ("--uv-set", 2, "-o", both, *FAST)
    assert run("unwrap", painted / "model.glb", *words).exit_code == 0
    done("bake", both, "--all", "--uv-set", 2, "-o", out)
    assert min(looks_alike(painted / "model.glb", out).values()) >= 40
    new = read(out)
    assert new.textured_sets() == {2}


def test_a_bake_of_one_image_leaves_none_behind_in_silence(painted: Path) -> None:
    """Into a GLB it is refused, before anything is written; into a PNG it is said."""
    words = ("bake", painted / "plain.glb", "--from", "texture", "--size", 64)
    words = (*words, "--source", painted / "model.glb")
    result = run(*words, "-o", painted / "new.glb")
    assert result.exit_code == 3
    assert (
        "its occlusion and normal textures" in result.stderr
    )  # the others are drawn for set 1, which stays
    assert "bake --all" in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (painted / "new.glb").exists()
    result = done(*words, "-o", painted / "new.png")
    assert "bake --all" in result.stderr


def test_faces_without_an_image_take_a_few_texels(tmp_path: Path) -> None:
    """The page goes to those with one; distortion is that of charts at the sizes meant for them."""
    g = Painted()
    shown = {"pbrMetallicRoughness": {"baseColorTexture": {"index": g.texture(waves(1, 16))}}}
    plain = {"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.7, 0.4, 1.0]}}
    (tmp_path / "m.glb").write_bytes(model([shown, plain, plain], g).glb())
    words = ("--rebake", "--size", 256, "--padding", 2, "-o", tmp_path / "new.glb")
    told = report("unwrap", tmp_path / "m.glb", *words, *FAST)
    assert told["distortion_max_chart"] <= 1.05
    assert (told["cut"], told["status"], told["look"]["materials"]) == ("charts", "ok", 1)
    new = read(tmp_path / "new.glb")
    layout = new.uv()
    texels = np.abs(areas(256 * layout.uv[layout.uv_faces])).reshape(3, -1).sum(1)
    assert texels[0] > 0.5 * 256**2
    assert (texels[1:] < 8**2).all()
    assert (texels[1:] > 3**2).all()
    looks = looks_alike(tmp_path / "m.glb", tmp_path / "new.glb")
    assert looks["base"] >= 40


def test_patterns_that_repeat_can_stay_as_they_are(tmp_path: Path) -> None:
    """Their material keeps its texture, transform and tangents in a uv set of its own; the other is carried."""
    g = Painted()
    moved = {"KHR_texture_transform": {"scale": [30.0, 30.0]}}
    pattern = {"index": g.texture(waves(1)), "extensions": moved}
    bump = {"index": g.texture(bumps(2)), "extensions": moved}
    once = {"baseColorTexture": {"index": g.texture(waves(3))}}
    tiled = {"pbrMetallicRoughness": {"baseColorTexture": pattern}, "normalTexture": bump}
    made = model([tiled, {"pbrMetallicRoughness": once}], g)
    made.tree["extensionsUsed"] = ["KHR_texture_transform"]
    (tmp_path / "m.glb").write_bytes(made.glb())
    out = tmp_path / "n.glb"
    words = ("--rebake", "--keep-tiled", "--check-look", "--size", 512, "-o", out)
    told = report("unwrap", tmp_path / "m.glb", *words, *UPRIGHT)
    assert told["psnr"] == told["look"]["check"]["psnr"] >= 50
    assert set(told["look"]["check"]["channels"]) == {"base colour", "normal"}
    assert not any(t["tiled"] for t in told["look"]["textures"])
    assert min(looks_alike(tmp_path / "m.glb", out).values()) >= 40
    new = read(out)
    kept, carried = new.tree.json["materials"]
    assert kept["normalTexture"]["texCoord"] == 2
    assert kept["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] == moved
    assert "texCoord" not in carried["pbrMetallicRoughness"]["baseColorTexture"]
    assert validate(out)[0] <= validate(tmp_path / "m.glb")[0]
    only = model([{"pbrMetallicRoughness": {"baseColorTexture": pattern}}], g)
    (tmp_path / "o.glb").write_bytes(only.glb())
    result = run("unwrap", tmp_path / "o.glb", "--rebake", "--keep-tiled")
    assert (result.exit_code, "all its textures repeat" in result.stderr) == (3, True)


def test_charts_get_texels_by_what_they_show(tmp_path: Path) -> None:
    """A sharp sheet, one of an eighth of its texels a side, and one without an image."""
    g = Painted()
    sharp, blurred = (
        {"baseColorTexture": {"index": g.texture(waves(k, n))}} for k, n in ((1, 512), (2, 64))
    )
    plain = {"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.3, 0.4, 1.0]}}
    materials = [{"pbrMetallicRoughness": sharp}, {"pbrMetallicRoughness": blurred}, plain]
    (tmp_path / "m.glb").write_bytes(model(materials, g).glb())
    out = tmp_path / "n.glb"
    words = ("--rebake", "--density", "source", "-o", out)
    told = report("unwrap", tmp_path / "m.glb", *words, *UPRIGHT)
    assert (told["flips"], told["overlap"]) == (0, 0)
    assert min(looks_alike(tmp_path / "m.glb", out).values()) >= 40
    new = read(out)
    layout = new.uv()
    area = np.abs(areas(layout.uv[layout.uv_faces])).reshape(3, -1).sum(1)
    np.testing.assert_allclose(np.sqrt(area[0] / area[1]), 8, rtol=0.1)
    assert area[2] < area[1]


def test_auto_takes_the_smallest_page_that_keeps_nine_tenths(tmp_path: Path) -> None:
    """An image of 700 texels a side over the whole sheet, once: 1024 keep it, and one half of that would
    not."""
    g = Painted()
    colour = {"baseColorTexture": {"index": g.texture(waves(1, 700))}}
    made = model([{"pbrMetallicRoughness": colour}], g)
    (tmp_path / "m.glb").write_bytes(made.glb())
    look = report("unwrap", tmp_path / "m.glb", "--rebake", *UPRIGHT)["look"]
    assert look["textures"][0]["density_kept"] >= 0.9
    half = ("--size", look["size"] // 2, "--overwrite", *UPRIGHT)
    smaller = run("unwrap", tmp_path / "m.glb", "--rebake", *half)
    assert json.loads(smaller.stdout)["look"]["textures"][0]["density_kept"] < 0.9
