"""What is listed, by what name, and what is refused."""

import os
import zipfile
from pathlib import Path

import pytest

from circparam.batch.sources import Listing, output_name
from circparam.batch.store import chained, is_remote
from circparam.errors import InputError, OptionError


def tree(folder: Path, *names: str) -> Path:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x" * len(name))
    return folder


def names(*given: object, out: object = None) -> list[str]:
    return sorted(
        s.name for s in Listing([str(g) for g in given], None if out is None else str(out))
    )


def test_a_folder_is_mirrored_and_only_meshes_count(tmp_path: Path) -> None:
    tree(tmp_path, "a.obj", "sub/b.GLB", "sub/deep/c.stl", "e_uv.obj")
    tree(tmp_path, "read.me", "sub/t.png", ".hidden/d.obj")
    assert names(tmp_path) == ["a.obj", "sub/b.GLB", "sub/deep/c.stl"]
    listing = Listing([str(tmp_path)])
    found = {s.name: s for s in listing}
    assert listing.own == 1
    assert found["sub/b.GLB"].size == len("sub/b.GLB")
    assert found["a.obj"].address == os.path.realpath(tmp_path / "a.obj")


def test_the_results_are_no_sources(tmp_path: Path) -> None:
    tree(tmp_path, "a.obj", "out/a.obj", "outer/a.obj")
    assert names(tmp_path, out=tmp_path / "out") == ["a.obj", "outer/a.obj"]
    assert names(tmp_path / "*" / "*.obj", out=tmp_path / "out") == ["outer/a.obj"]


def test_globs_and_files(tmp_path: Path) -> None:
    tree(tmp_path, "x/a.obj", "x/y/b.obj", "x/y/c.ply", "x/[1].obj")
    assert names(tmp_path / "x" / "**" / "*.obj") == ["[1].obj", "a.obj", "y/b.obj"]
    assert names(tmp_path / "x/y/c.ply") == ["c.ply"]
    assert names(tmp_path / "x/[1].obj") == ["[1].obj"]  # a file of that name, no glob
    with pytest.raises(InputError, match="no mesh file has a name"):
        names(tmp_path / "x/*.glb")
    with pytest.raises(InputError, match="no such file or folder"):
        names(tmp_path / "nowhere")


def test_stars_enter_no_linked_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Links that lead back would list a tree forty times, two of them in each folder for ever."""
    tree(tmp_path, "x/a.obj", "x/y/b.obj", "x/y/y/c.obj", "x/.hidden/d.obj")
    for name in ("x/back", "x/again", "x/y/up"):
        (tmp_path / name).symlink_to(tmp_path / "x", target_is_directory=True)
    every = ["a.obj", "y/b.obj", "y/y/c.obj"]
    for pattern in ("**/*.obj", "**", "**/**/*.obj"):
        assert names(tmp_path / "x" / pattern) == every
    assert names(tmp_path / "x/**/y/**/c.obj") == ["y/y/c.obj"]
    assert names(tmp_path / "x/back/*.obj") == ["a.obj"]
    monkeypatch.chdir(tmp_path / "x")
    assert names(Path("**/*.obj")) == every


def test_lists(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tree(tmp_path, "x/a.obj", "x/y/b.obj", "z/new\nline.obj")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "l.txt").write_text(f"#two\n   \nx/a.obj\r\n\n{tmp_path / 'x/y/b.obj'}\nx/y\n")
    whole = str(tmp_path / "x/y/b.obj").lstrip("/")
    assert names("@l.txt") == sorted(["x/a.obj", whole, "x/y/b.obj"])
    (tmp_path / "nul.txt").write_bytes(b"x/a.obj\0z/new\nline.obj\0")
    assert names("@nul.txt") == ["x/a.obj", "z/new\nline.obj"]
    (tmp_path / "mark.txt").write_text("x/a.obj\r\n", encoding="utf-8-sig", newline="")
    assert names("@mark.txt") == ["x/a.obj"]
    (tmp_path / "up.txt").write_text("../x/a.obj\n")
    with pytest.raises(InputError, match="leads out of the folder"):
        names("@up.txt")
    with pytest.raises(InputError, match="the list cannot be read"):
        names("@nothing.txt")


def test_names_that_are_no_utf8(tmp_path: Path) -> None:
    path = os.fsencode(tmp_path) + b"/\xff\n.obj"
    with open(path, "wb"):
        pass
    assert names(tmp_path) == [os.fsdecode(b"\xff\n.obj")]


def test_the_result_has_a_format_with_uv() -> None:
    assert output_name("a/b.STL") == "a/b.glb"
    assert output_name("b.coff") == "b.glb"
    assert output_name("a.b/c.PLY") == "a.b/c.PLY"
    with pytest.raises(OptionError, match="no mesh format"):
        output_name("a.txt")


def test_archives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("fsspec")
    monkeypatch.chdir(tmp_path)
    with zipfile.ZipFile("a.zip", "w") as archive:
        for name in ("in/a.glb", "in/b.glb", "c.obj", "in/t.png"):
            archive.writestr(name, b"xy")
    both = ["a.glb", "b.glb"]
    assert names("zip://a.zip::in/*.glb") == both  # the archive first
    assert names("zip://in/*.glb::a.zip") == both  # as fsspec has it
    assert names("zip://in::a.zip") == both
    (one,) = Listing(["zip://c.obj::a.zip"])
    assert (one.name, one.size) == ("c.obj", 2)
    assert one.address == f"zip://c.obj::{tmp_path / 'a.zip'}"  # wherever a worker runs
    with pytest.raises(InputError, match=r"no mesh file is there|no such file"):
        names("zip://*.ply::a.zip")


def test_what_is_remote() -> None:
    assert is_remote("s3://b/k.obj")
    assert not is_remote("file:///a.obj")
    assert not is_remote("C://a.obj")
    assert not is_remote("a.obj")
    assert chained("zip://a.zip::x/*.glb") == "zip://x/*.glb::a.zip"
    assert chained("zip://x/*.glb::s3://b/a.zip") == "zip://x/*.glb::s3://b/a.zip"


def test_a_missing_driver_is_one_line() -> None:
    pytest.importorskip("fsspec")
    with pytest.raises((OptionError, InputError), match=r"^gs://bucket/m: .*gcsfs"):
        names("gs://bucket/m")
