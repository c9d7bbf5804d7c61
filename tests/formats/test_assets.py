"""The files that an output refers to: copied when asked, named when they will not resolve."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from circparam.errors import OptionError, OutputError
from circparam.formats.assets import find_assets
from circparam.formats.document import Encoded, WriteOptions
from circparam.formats.io import read, write
from circparam.formats.source import Source
from tests.support.formats_tools import smooth_layout
from tests.support.full_disk import fill_up
from tests.support.gltf_files import full_mesh


def test_materials_and_textures_go_along(tmp_path: Path) -> None:
    source, out = tmp_path / "in", tmp_path / "out"
    (source / "tex").mkdir(parents=True)
    out.mkdir()
    (source / "my mat.mtl").write_text(
        "newmtl a\nmap_Kd -s 2 2 tex\\a.png\nmap_bump two words.png\nbump ../secret.png\nmap_Ks no.png\n"
    )
    (source / "tex" / "a.png").write_bytes(b"a")
    (source / "two words.png").write_bytes(b"b")
    (tmp_path / "secret.png").write_bytes(b"s")
    text = "mtllib my mat.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (source / "x.obj").write_text(text)
    doc = read(source / "x.obj")
    bare = write(out / "x.obj", doc, smooth_layout(doc), options=WriteOptions(copy_assets=False))
    assert any("my mat.mtl" in n and "--no-copy-assets" in n for n in bare.warnings)
    assert [p.name for p in out.iterdir()] == ["x.obj"]
    copied = write(out / "y.obj", doc, smooth_layout(doc))
    assert {str(p.relative_to(out)) for p in copied.files} == {
        "y.obj", "my mat.mtl", os.path.join("tex", "a.png"), "two words.png",
    }  # fmt: skip
    assert any("secret" in n and "outside" in n for n in copied.warnings)
    assert any("no.png" in n and "not there" in n for n in copied.warnings)
    (out / "two words.png").write_bytes(b"another")
    with pytest.raises(OptionError, match="two words"):
        write(out / "z.obj", doc, smooth_layout(doc), options=WriteOptions(copy_assets=True))
    assert not (out / "z.obj").exists()
    kept = write(out / "z.obj", doc, smooth_layout(doc))
    assert any("two words" in n and "another file" in n for n in kept.warnings)
    assert (out / "two words.png").read_bytes() == b"another"
    write(out / "z.obj", doc, smooth_layout(doc), overwrite=True)
    assert (out / "two words.png").read_bytes() == b"b"


def found(
    tmp_path: Path, *names: str, copy: bool | None = False, same: bool = False, needed: bool = False
):
    folder, out = tmp_path / "in", tmp_path / "out"
    for each in (folder, out):
        each.mkdir(exist_ok=True)
    (folder / "a b.png").write_bytes(b"ab")
    (folder / "a").write_bytes(b"a")
    encoded = Encoded(b"", "obj", np.arange(1), np.arange(1), assets=list(names))
    encoded = replace(encoded, needed=list(names) if needed else [])
    source = Source("x", folder / "x.obj")
    copies, _, warnings = find_assets(source, encoded, (folder if same else out) / "y.obj", copy)
    return copies, warnings


def test_a_name_with_blanks_is_one_file_or_several(tmp_path: Path) -> None:
    copies, notes = found(tmp_path, "a b.png", "a none", copy=True)
    assert {p.name: data for p, data in copies.items()} == {"a b.png": b"ab", "a": b"a"}
    assert notes == ["'none' is named by the file and is not there"]


def external(tmp_path: Path) -> Path:
    """A glTF whose buffer and image lie beside it."""
    g = full_mesh()
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "t.bin").write_bytes(g.bin)
    (folder / "t.png").write_bytes(b"\x89PNG and more")
    g.tree["images"] = [{"uri": "t.png"}]
    g.tree["textures"] = [{"source": 0}]
    (folder / "t.gltf").write_bytes(g.gltf("t.bin"))
    return folder / "t.gltf"


def test_a_glb_takes_the_images_in(tmp_path: Path) -> None:
    document = read(external(tmp_path))
    out = tmp_path / "out"
    out.mkdir()
    written = write(out / "new.glb", document, smooth_layout(document))
    assert [p.name for p in written.files] == ["new.glb"]
    tree = read(out / "new.glb").tree
    (image,) = tree.json["images"]
    assert image == {"bufferView": image["bufferView"], "mimeType": "image/png", "name": "t"}
    assert tree.view(image["bufferView"], "")[0].tobytes() == b"\x89PNG and more"


def test_a_folder_made_for_textures_goes_when_the_write_fails(tmp_path, monkeypatch):
    (tmp_path / "in" / "tex").mkdir(parents=True)
    (tmp_path / "out").mkdir()
    (tmp_path / "in" / "tex" / "k.png").write_bytes(b"k")
    (tmp_path / "in" / "m.mtl").write_text("newmtl x\nmap_Kd tex/k.png\n")
    (tmp_path / "in" / "x.obj").write_text("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    doc = read(tmp_path / "in" / "x.obj")
    fill_up(monkeypatch, "fsync")
    with pytest.raises(OutputError):
        write(tmp_path / "out" / "x.obj", doc, smooth_layout(doc))
    assert list((tmp_path / "out").iterdir()) == []
