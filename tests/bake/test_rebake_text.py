"""OBJ with MTL, and PLY with TextureFile: their images go along as those of glTF do."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.bake.look_source import Source
from circparam.core.arrays import FloatArray
from circparam.errors import InputError
from circparam.formats.io import read
from circparam.formats.materials import srgb
from circparam.mesh.mesh import UVMap
from tests.bake.test_rebake import UPRIGHT
from tests.support.baking import sheet, write_obj
from tests.support.command_line import done, one_line_error, report, run
from tests.support.looks import bumps, psnr, waves
from tests.support.ply_files import INDEX, XYZ, build


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """m.obj: a sheet of two materials with images of their own, one scaled and moved by options."""
    points, faces = sheet(8)
    layout = UVMap(points[:, :2] * 1.3 - 0.1, faces)
    write_obj(tmp_path / "m.obj", points, layout, faces, mtl="m.mtl")
    lines = (tmp_path / "m.obj").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("f "))
    lines.insert(first + len(faces) // 2, "usemtl second  ")
    (tmp_path / "m.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "m.mtl").write_text(
        "# kept by nobody\nnewmtl m\nNs 10\nKd 0.9 0.8 0.7\nmap_Kd -s 2 0.5 1 -o 0.25 0.1 a.png\nmap_Ks s.png\n"
        "map_Bump -bm 0.5 n.png\nnewmtl unused\nmap_Kd old.png\nnewmtl second\nNs 10\nKd 0.5 0.6 0.9\n"
        "map_Kd b.png\nmap_Ks s.png\nmap_Bump -bm 0.5 n.png\n"
    )
    for name, image in (("a", waves(1)), ("b", waves(2)), ("s", waves(3)), ("n", bumps(4))):
        Image.fromarray(image).save(tmp_path / f"{name}.png")
    return tmp_path


def shown(path: Path, page: str, m: int) -> FloatArray:
    """What the images of a slot, named by its page, show at points of the m faces of a file."""
    source = Source.of(read(path))
    rng = np.random.default_rng(1)
    face, bary = rng.integers(0, m, 5000), rng.dirichlet([1, 1, 1], 5000)
    out = np.zeros((len(face), 3))
    for k, material in enumerate(source.looks.materials):
        at = np.flatnonzero(source.looks.face[face] == k)
        for slot, use in material.uses.items():
            if slot.page == page:
                place = (source.places(use)[0][face[at]] * bary[at][..., None]).sum(1)
                image = source.sampled(use, True)
                out[at] = srgb(image.blend(image.taps(*place.T, use, 0), 0)[:, :3])
    return out


def test_a_batch_carries_textures_as_unwrap_does(folder: Path, shared: str) -> None:
    """--rebake was taken and had no effect, and --one-atlas has no sense there."""
    words = ("--rebake", "--size", 64, "--padding", 1, *UPRIGHT[:-3])
    done("unwrap", folder / "m.obj", *words, "-j", 1, "--out-dir", folder / "one")
    where = ("--scheduler", shared, "--out", folder / "many")
    done("batch", folder / "m.obj", *words, *where, "--fail-if", "flips>0")
    written = [path for path in (folder / "one").iterdir() if path.suffix != ".obj"]
    assert {path.suffix for path in written} == {".mtl", ".png"}
    for path in (*written, folder / "one" / "m.obj"):
        assert (folder / "many" / path.name).read_bytes() == path.read_bytes(), path.name
    line = json.loads((folder / "many" / "manifest.jsonl").read_text().splitlines()[-1])
    assert line["measures"]["look"]["materials"] == 1
    one_line_error(run("batch", folder, "--out", folder / "x", "--size", 64), 2, "--rebake")
    assert run("batch", folder, "--out", folder / "x", "--one-atlas").exit_code == 2


@pytest.mark.parametrize(
    ("words", "materials", "page"),
    [((), 1, "map_ks"), (("--merge-materials", "none"), 2, "map_kd")],  # merged ones share one Kd
    ids=["merged", "apart"],
)
def test_an_obj_keeps_its_images(folder, words, materials, page):
    """Beside a library of its own; each material shows what it showed."""
    out = folder / "out" / "new.obj"
    out.parent.mkdir()
    size = ("--rebake", "--size", 256, "-o", out)
    told = report("unwrap", folder / "m.obj", *size, *words, *UPRIGHT)
    assert told["look"]["materials"] == materials
    assert ("usemtl second" in out.read_text()) == (materials == 2)
    library = (out.parent / "new.mtl").read_text()
    assert "map_Kd old.png" in library  # of a material that no face has
    assert "map_Bump -bm 0.5 new_map_bump.png" in library
    assert sorted(p.stem for p in out.parent.iterdir() if p.suffix == ".png") == [
        "new_map_bump", "new_map_kd", "new_map_ks",
    ]  # fmt: skip
    old, new = (shown(p, page, len(read(out).mesh.faces)) for p in (folder / "m.obj", out))
    assert psnr(old, new) >= 40


def test_a_ply_keeps_its_image(tmp_path: Path) -> None:
    points, faces = sheet(8)
    rows = np.c_[points, points[:, :2]].tolist()
    vertex = [*XYZ, "double s", "double t"], rows
    data = build("ascii", {"vertex": vertex, "face": ([INDEX], [[f] for f in faces.tolist()])})
    named = data.replace(b"comment made by a test", b"comment TextureFile skin.png")
    (tmp_path / "m.ply").write_bytes(named)
    Image.fromarray(waves(3)).save(tmp_path / "skin.png")
    out = tmp_path / "new.ply"
    done("unwrap", tmp_path / "m.ply", "--rebake", "--size", 256, "-o", out, *UPRIGHT)
    assert b"comment TextureFile new_texture.png" in out.read_bytes()
    assert psnr(*(shown(path, "texture", len(faces)) for path in (tmp_path / "m.ply", out))) >= 40


def test_missing_files_are_named_before_the_work(folder: Path) -> None:
    (folder / "s.png").unlink()
    result = run("unwrap", folder / "m.obj", "--rebake", "-o", folder / "new.obj")
    assert result.exit_code == 3
    assert "s.png" in result.stderr
    assert result.stderr.count("\n") == 1
    (folder / "m.mtl").unlink()
    with pytest.raises(InputError, match=r"m\.mtl"):
        Source.of(read(folder / "m.obj"))
    assert not (folder / "new.obj").exists()


def test_a_coloured_bump_map_holds_normals(folder: Path) -> None:
    """Many programs write normal maps as map_Bump; grey ones hold heights."""
    document = read(folder / "m.obj")
    looks = document.looks()
    kinds = {s.kind for m in looks.materials for s in m.uses if s.page == "map_bump"}
    assert kinds == {"normal"}
    Image.fromarray(waves(4)[..., 0]).save(folder / "n.png")
    looks = read(folder / "m.obj").looks()
    kinds = {s.kind for m in looks.materials for s in m.uses if s.page == "map_bump"}
    assert kinds == {"product"}


def test_levels_that_are_rounded_are_told(folder: Path) -> None:
    """A height of 16 bits became one of 8 without a word."""
    heights = np.linspace(0, 65535, 64 * 64).astype(np.uint16).reshape(64, 64)
    Image.fromarray(heights).save(folder / "n.png")
    got = report("unwrap", folder / "m.obj", "-o", folder / "o.obj", "--rebake", *UPRIGHT)
    assert "texture n.png has 16 bits a channel, the new image 8" in got["warnings"]
    assert not any("a.png has 16" in line for line in got["warnings"])


@pytest.mark.parametrize("suffix", ["glb", "png"])
def test_the_colour_that_one_image_carries_is_not_left_behind(folder: Path, suffix: str) -> None:
    """``map_Kd`` is the base colour of OBJ: it neither hinders a GLB nor is it called lost."""
    (folder / "m.mtl").write_text("newmtl m\nmap_Kd a.png\nnewmtl second\nmap_Kd b.png\n")
    new = folder / "new.obj"
    points, faces = sheet(8)
    write_obj(new, points, UVMap(0.1 + 0.8 * points[:, :2], faces), faces, mtl="m.mtl")
    words = ("--from", "texture", "--source", folder / "m.obj", "--size", 32)
    result = done("bake", new, *words, "-o", folder / f"out.{suffix}")
    assert "bake --all" not in result.stderr
