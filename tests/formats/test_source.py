"""Where bytes come from: errors that name the file, and names that stay inside its folder."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from circparam.errors import InputError
from circparam.formats.source import bytes_beside, read_bytes, safe_path


@pytest.mark.parametrize("name", ["a.png", "b/c.png", "two words.png", "a%20b.png", "./x", "a..b"])
def test_names_inside_the_folder(tmp_path: Path, name: str) -> None:
    found = safe_path(tmp_path, name)
    assert found is not None
    assert found == (tmp_path / name.replace("%20", " ")).resolve()


@pytest.mark.parametrize(
    "name",
    ["../a", "b/../../a", "/a", "\\a", "..\\b", "C:/a", "file:a", "x\0", "%2e%2e/a", "http://h/a",
     "a\ud800.png", "tex\\..\\..\\a.png", "\\\\server\\a.png", "C:\\a.png"],
)  # fmt: skip
def test_names_that_lead_elsewhere(tmp_path: Path, name: str) -> None:
    assert safe_path(tmp_path, name) is None


def test_names_of_a_file_are_found_in_a_locale_of_ascii(tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text(
        "mtllib \u00e9.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n", "utf-8"
    )
    (tmp_path / "\u00e9.mtl").write_text("newmtl a\nmap_Kd \u00fc.png\n", "utf-8")
    (tmp_path / "\u00fc.png").write_bytes(b"image")
    code = (
        "import sys; from circparam.formats.io import read; found = read(sys.argv[1]).textures(); "
        "assert found.images == (b'image',), found.notes"
    )
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = [sys.executable, "-c", code, str(tmp_path / "m.obj")]
    done = subprocess.run(words, env=os.environ | locale, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(b"data")
    data, source = read_bytes(tmp_path / "x")
    assert (data, source.path, source.name) == (b"data", tmp_path / "x", str(tmp_path / "x"))
    (tmp_path / "blank").write_bytes(b" \n\n")
    (tmp_path / "void").touch()
    for name, says in (
        ("none", "no such file"),
        ("", "directory"),
        ("blank", "empty"),
        ("void", "empty"),
    ):
        with pytest.raises(InputError, match=says) as caught:
            read_bytes(tmp_path / name)
        assert str(caught.value).startswith(f"{tmp_path / name}: ")
        assert "\n" not in str(caught.value)
    for device in ("/dev/null", "/dev/tty"):
        if Path(device).exists():
            with pytest.raises(InputError, match="device"):
                read_bytes(device)


def test_names_with_a_percent_sign_are_names(tmp_path: Path) -> None:
    """As they stand where such a file is there, as a URI else."""
    (tmp_path / "50%20grey.png").write_bytes(b"a")
    (tmp_path / "two words.png").write_bytes(b"b")
    assert safe_path(tmp_path, "50%20grey.png") == (tmp_path / "50%20grey.png").resolve()
    assert safe_path(tmp_path, "two%20words.png") == (tmp_path / "two words.png").resolve()
    assert safe_path(tmp_path, "%2e%2e/x") is None


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_pipe_in_the_place_of_a_file_is_refused_at_once(tmp_path: Path) -> None:
    """As a buffer, as an image, as a material library: nobody ever writes to it."""
    os.mkfifo(tmp_path / "pipe.bin")
    with pytest.raises(OSError, match="not a regular file"):
        bytes_beside(tmp_path, "pipe.bin")
    with pytest.raises(OSError, match="outside"):
        bytes_beside(tmp_path, "../pipe.bin")
    with pytest.raises(OSError, match="outside"):
        bytes_beside(None, "pipe.bin")
    (tmp_path / "a.bin").write_bytes(b"12345")
    assert (bytes_beside(tmp_path, "a.bin"), bytes_beside(tmp_path, "a.bin", 2)) == (
        b"12345",
        b"12",
    )
