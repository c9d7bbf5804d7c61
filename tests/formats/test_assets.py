"""The files that an output refers to: copied when asked, named when they will not resolve."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from circparam.errors import OptionError
from circparam.formats.document import WriteOptions
from circparam.formats.io import read, write
from circparam.formats.memory import from_arrays
from tests.support.formats_tools import (
    grid,
    smooth_layout,
)


def document():
    points, faces = grid(4)
    return from_arrays(points, faces)


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
    plain = write(out / "x.obj", doc, smooth_layout(doc))
    assert any("my mat.mtl" in n and "--copy-assets" in n for n in plain.notes)
    assert [p.name for p in out.iterdir()] == ["x.obj"]
    copied = write(out / "y.obj", doc, smooth_layout(doc), options=WriteOptions(copy_assets=True))
    assert {str(p.relative_to(out)) for p in copied.files} == {
        "y.obj", "my mat.mtl", os.path.join("tex", "a.png"), "two words.png",
    }  # fmt: skip
    assert any("secret" in n and "outside" in n for n in copied.notes)
    assert any("no.png" in n and "not there" in n for n in copied.notes)
    (out / "two words.png").write_bytes(b"another")
    with pytest.raises(OptionError, match="two words"):
        write(out / "z.obj", doc, smooth_layout(doc), options=WriteOptions(copy_assets=True))
    assert not (out / "z.obj").exists()
