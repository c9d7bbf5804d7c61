"""The list of temporary files, which cli/signals knows by the name of this module only."""

import subprocess
import sys
from pathlib import Path

import pytest

from circparam.cli.exits import TERMINATED
from circparam.core import files
from circparam.errors import OptionError, OutputError
from tests.support.processes import printed

WATCHED = """
import os, socket, sys, threading
from circparam.cli import signals
reader, writer = socket.socketpair()
writer.send(bytes([signals.signal.SIGTERM]))
signals.GRACE_SECONDS = 0.0
os._exit = lambda code: print(code, *sys.modules)
signals._watch(reader, threading.Event())
"""


def test_signals_do_not_import_what_writes_files() -> None:
    """The reason for the string: to handle a signal nothing is loaded that the work did not need."""
    code, *modules = printed(WATCHED).split()
    assert code == str(TERMINATED)
    assert "circparam.core.files" not in modules


KILLED = """
import os, signal, sys
from pathlib import Path
from circparam.core import files
os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
files.write_files({Path(sys.argv[1]): b"new"}, overwrite=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="it has no SIGKILL and no such locks")
def test_what_a_killed_write_has_left_goes_with_the_next_one(tmp_path: Path) -> None:
    """And neither what another process writes just now, nor what has another name."""
    path = tmp_path / "out [1].obj"
    path.write_bytes(b"old")
    subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert path.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 2
    kept = [tmp_path / f".{path.name}.1.tmp", tmp_path / ".other.obj.999999.tmp"]
    busy = tmp_path / f".{path.name}.999999.tmp"
    for one in (*kept, busy):
        one.write_bytes(b"being written")
    with open(busy, "rb") as file:
        assert files.lock(file)
        files.write_files({path: b"new"}, overwrite=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in (path, busy, *kept))
    assert path.read_bytes() == b"new"


def test_two_names_of_one_file_are_refused_before_the_first_byte(tmp_path: Path) -> None:
    """By way of a folder above, or of a link."""
    real, link = tmp_path / "real", tmp_path / "link"
    real.mkdir()
    link.symlink_to(real)
    for other in (real / ".." / "real" / "a", link / "a"):
        with pytest.raises(OptionError, match="are one file"):
            files.write_files({real / "a": b"1", other: b"2", real / "b": b"3"})
        assert list(real.iterdir()) == []


def test_a_link_into_a_folder_that_is_missing_names_this_folder(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "gone" / "file")
    with pytest.raises(OutputError, match=r"link: the folder .*gone' does not exist"):
        files.write_files({link: b"x"})


def test_what_is_there_stays_unless_it_may_be_replaced(tmp_path: Path) -> None:
    old, new, folder = tmp_path / "old", tmp_path / "new", tmp_path / "folder"
    old.write_text("mine")
    folder.mkdir()
    for path, overwrite, error, says in (
        (old, False, OptionError, "--overwrite"),
        (folder, True, OutputError, "is a directory"),
    ):
        with pytest.raises(error, match=says):
            files.write_files({new: b"x", path: b"y"}, overwrite)
        assert sorted(tmp_path.iterdir()) == [folder, old]
    files.write_files({new: b"x", old: b"y"}, True)
    assert (new.read_bytes(), old.read_bytes()) == (b"x", b"y")


def test_a_link_to_itself_is_refused_and_stays(tmp_path: Path) -> None:
    link = tmp_path / "loop.obj"
    link.symlink_to(link.name)
    for overwrite in (False, True):
        with pytest.raises(OutputError, match=r"loop\.obj: cannot be written"):
            files.write_files({link: b"x"}, overwrite)
    assert link.is_symlink()


def test_folders_are_made_with_their_parents_and_the_empty_ones_go_again(tmp_path: Path) -> None:
    used, empty = tmp_path / "a" / "b", tmp_path / "a" / "c" / "d"
    with files.made_folders([used, empty, tmp_path]):
        assert empty.is_dir()
        (used / "out.obj").write_bytes(b"")
    assert [p.name for p in sorted(tmp_path.rglob("*"))] == ["a", "b", "out.obj"]
