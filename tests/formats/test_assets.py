"""The files that an output refers to: copied when asked, named when they will not resolve."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.formats.assets import find_assets
from circparam.formats.document import Encoded, WriteOptions
from circparam.formats.io import read, write
from circparam.formats.memory import from_arrays
from circparam.formats.source import Source
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


def found(tmp_path: Path, *names: str, copy: bool = False, same: bool = False):
    folder, out = tmp_path / "in", tmp_path / "out"
    for each in (folder, out):
        each.mkdir(exist_ok=True)
    (folder / "a b.png").write_bytes(b"ab")
    (folder / "a").write_bytes(b"a")
    encoded = Encoded(b"", "obj", np.arange(1), np.arange(1), assets=list(names))
    source = Source("x", folder / "x.obj")
    return find_assets(source, encoded, (folder if same else out) / "y.obj", copy)


def test_a_name_with_blanks_is_one_file_or_several(tmp_path: Path) -> None:
    copies, notes = found(tmp_path, "a b.png", "a none", copy=True)
    assert {p.name: data for p, data in copies.items()} == {"a b.png": b"ab", "a": b"a"}
    assert notes == ["'none' is named by the file and is not there"]


def test_the_same_folder_needs_no_copy(tmp_path: Path) -> None:
    assert found(tmp_path, "a", "none", copy=True, same=True) == (
        {},
        ["'none' is named by the file and is not there"],
    )


def test_copies_only_when_asked_and_only_what_differs(tmp_path: Path) -> None:
    assert found(tmp_path, "a") == ({}, ["'a' won't resolve from 'out': use --copy-assets"])
    (tmp_path / "out" / "a").write_bytes(b"a")
    assert found(tmp_path, "a", copy=True) == ({}, [])
    (tmp_path / "out" / "a").write_bytes(b"other")
    copies, _ = found(tmp_path, "a", copy=True)
    assert list(copies.values()) == [b"a"]


def test_what_came_from_memory_has_nothing_beside_it(tmp_path: Path) -> None:
    encoded = Encoded(b"", "obj", np.arange(1), np.arange(1), assets=["a"])
    assert find_assets(Source("x"), encoded, tmp_path / "y.obj", True) == ({}, [])


def test_images_of_a_material_file_come_along_in_folders(tmp_path: Path) -> None:
    (tmp_path / "in" / "tex").mkdir(parents=True)
    (tmp_path / "in" / "tex" / "k.png").write_bytes(b"k")
    (tmp_path / "in" / "m.mtl").write_bytes(
        b"newmtl x\n\tmap_Kd -s 1 1 tex/k.png \r\nnorm a\nKd 1 1 1\nmap_Kd\n"
    )
    copies, notes = found(tmp_path, "m.mtl", copy=True)
    out = (tmp_path / "out").resolve()
    assert {p.relative_to(out).as_posix() for p in copies} == {"m.mtl", "tex/k.png", "a"}
    assert (out / "tex").is_dir()
    assert notes == []
