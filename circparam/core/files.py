"""Files that appear whole or not at all: written under another name, flushed to the disk, then renamed."""

import contextlib
import glob
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO

from circparam.errors import OptionError, OutputError

# Files that exist only during a write; an abrupt end has to remove them.
TEMPORARIES: list[Path] = []


def write_files(
    contents: Mapping[Path, bytes],
    overwrite: bool = False,
    *,
    inside: Path | None = None,
    durable: bool = True,
) -> list[Path]:
    """Write several files, all or none, the last one last (it may refer to those before it).

    inside: missing folders are made below this one. durable: files are flushed to the disk, so a power cut
    loses none; files that are rewritten often do not need it. Raises OptionError if a file exists and may not
    be replaced, or if two names are one file; OutputError if the disk refuses. An error or an interrupt leaves
    nothing behind.
    """
    places: dict[str, Path] = {}
    for path in contents:
        if (other := places.setdefault(os.path.realpath(path), path)) is not path:
            raise OptionError(
                f"{path} and {other} are one file: give each output a name of its own"
            )
    for path in contents:
        if path.is_dir():
            raise OutputError(f"{path}: this is a directory; name a file")
        check_free(path, overwrite)
    folders = [path.parent for path in contents if inside in path.parent.parents]
    try:
        below = folders if inside is not None and inside.is_dir() else []
        with made_folders(below), _staged(contents, durable) as staged:
            for real, temporary in staged:
                if real.exists() and not real.is_file():  # a pipe or a device: no renaming over it
                    real.write_bytes(temporary.read_bytes())
                else:
                    os.replace(temporary, real)
            if durable:
                # make the renames themselves durable, where the system can
                for folder in dict.fromkeys(real.parent for real, _ in staged):
                    with contextlib.suppress(OSError):
                        handle = os.open(folder, os.O_RDONLY)
                        try:
                            os.fsync(handle)
                        finally:
                            os.close(handle)
    except OSError as error:
        where = next(reversed(list(contents)), "output")
        raise OutputError(f"{where}: cannot be written ({error.strerror or error})") from None
    return list(contents)


def check_free(path: Path, overwrite: bool) -> None:
    """Refuse a place where a file lies that may not be replaced. Raises OptionError."""
    if is_there(path) and not overwrite:
        raise OptionError(f"{path}: the file exists; replace it with --overwrite")


def is_there(path: str | Path) -> bool:
    """Whether something has this name. Raises OutputError if the system refuses the name: a link to itself."""
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return False
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from None
    return True


@contextlib.contextmanager
def made_folders(folders: Iterable[Path]) -> Iterator[None]:
    """Make folders and their parents where they are missing; those that stay empty go again."""
    made: list[Path] = []
    try:
        for folder in folders:
            for path in reversed([p for p in (folder, *folder.parents) if not p.exists()]):
                path.mkdir()
                made.append(path)
        yield
    finally:
        for path in reversed(made):
            with contextlib.suppress(OSError):  # a folder with files stays
                path.rmdir()


@contextlib.contextmanager
def _staged(contents: Mapping[Path, bytes], durable: bool) -> Iterator[list[tuple[Path, Path]]]:
    """The contents under temporary names beside their places, flushed if durable; leftovers are removed."""
    staged: list[tuple[Path, Path]] = []
    held = contextlib.ExitStack()
    try:
        for path, data in contents.items():
            real = Path(os.path.realpath(path))  # write through a link, not over it
            if not real.parent.is_dir():
                lacking = str(real.parent if path.is_symlink() else path.parent)
                raise OutputError(f"{path}: the folder {lacking!r} does not exist")
            folder = real.parent
            # no file may be made beside a pipe or a device
            if real.exists() and not real.is_file():
                import tempfile

                folder = Path(tempfile.gettempdir())
            temporary = folder / f".{real.name}.{os.getpid()}.tmp"
            _clear_left(folder, real.name)
            TEMPORARIES.append(temporary)
            staged.append((real, temporary))
            with contextlib.ExitStack() as now:
                file = open(temporary, "wb")  # noqa: SIM115
                (held if lock(file) else now).enter_context(file)
                file.write(data)
                file.flush()
                if durable:
                    os.fsync(file.fileno())
            if real.is_file():  # a file that is replaced keeps its permissions
                os.chmod(temporary, stat.S_IMODE(real.stat().st_mode))
        yield staged
    finally:
        for _, temporary in staged:
            with contextlib.suppress(OSError):
                temporary.unlink()
            TEMPORARIES.remove(temporary)
        held.close()


def lock(file: IO[bytes] | int) -> bool:
    """Lock an open file or folder until it closes or this process ends. Returns whether that succeeded.

    False if another process holds the lock, or if the system has no such locks.
    """
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError):
        return False
    return True


def _clear_left(folder: Path, name: str) -> None:
    """Remove temporary files of a file whose writers were killed, so that no process holds their locks."""
    for left in folder.glob(f".{glob.escape(name)}.*.tmp"):
        number = left.name.split(".")[-2]
        with contextlib.suppress(OSError):
            if number.isdecimal() and not _runs(int(number)):
                with open(left, "rb") as file:
                    if lock(file):
                        left.unlink()


def _runs(pid: int) -> bool:
    """Whether a process of this number runs on this machine."""
    try:
        os.kill(pid, 0) if os.name == "posix" else None
    except ProcessLookupError:
        return False
    except OSError:
        pass
    return True
