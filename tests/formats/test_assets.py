"""The files that an output refers to: copied when asked, named when they will not resolve."""

import os
from pathlib import Path

import pytest

from circparam.errors import OptionError, OutputError
from circparam.formats.document import WriteOptions
from circparam.formats.io import read, write
from tests.support.formats_tools import smooth_layout
from tests.support.full_disk import fill_up


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
    (source / "b.mtl").touch()
    text = "mtllib my mat.mtl\nmtllib b.mtl none\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (source / "x.obj").write_text(text)
    doc = read(source / "x.obj")
    bare = write(out / "x.obj", doc, smooth_layout(doc), options=WriteOptions(copy_assets=False))
    assert any("my mat.mtl" in n and "--no-copy-assets" in n for n in bare.warnings)
    assert [p.name for p in out.iterdir()] == ["x.obj"]
    copied = write(out / "y.obj", doc, smooth_layout(doc))
    assert {str(p.relative_to(out)) for p in copied.files} == {
        "y.obj", "my mat.mtl", "b.mtl", os.path.join("tex", "a.png"), "two words.png",
    }  # fmt: skip
    assert any("secret" in n and "outside" in n for n in copied.warnings)
    for name in ("no.png", "none"):  # a name with blanks is one file or several
        assert f"'{name}' is named by the file and is not there" in copied.warnings
    (out / "two words.png").write_bytes(b"another")
    with pytest.raises(OptionError, match="two words"):
        write(out / "z.obj", doc, smooth_layout(doc), options=WriteOptions(copy_assets=True))
    assert not (out / "z.obj").exists()
    kept = write(out / "z.obj", doc, smooth_layout(doc))
    assert any("two words" in n and "another file" in n for n in kept.warnings)
    assert (out / "two words.png").read_bytes() == b"another"
    write(out / "z.obj", doc, smooth_layout(doc), overwrite=True)
    assert (out / "two words.png").read_bytes() == b"b"


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
