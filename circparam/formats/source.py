"""Where bytes come from: a source by name, its content, and the files that lie beside it."""

import io
import os
import re
import stat
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote

from circparam.core.records import dataclass
from circparam.errors import InputError

TEXT_START_BYTES = 4096  # bytes in which anything but blanks stands at first


@dataclass(frozen=True)
class Source:
    """Where bytes came from: ``name`` for messages, ``path`` None for standard input or memory."""

    name: str
    path: Path | None = None

    @property
    def folder(self) -> Path | None:
        """The folder that relative names in the file start from; None if there is none."""
        return None if self.path is None else self.path.resolve().parent

    def error(self, cause: object) -> InputError:
        """An InputError that names the file, in one line."""
        return InputError(f"{self.name}: {' '.join(str(cause).split())}")


def read_bytes(
    path: str | os.PathLike[str], blocks: Callable[[BinaryIO], Iterable[bytes]] = iter
) -> tuple[bytes, Source]:
    """The content of a file, or of standard input for ``-``; InputError if it cannot be read or is empty.

    blocks: a reader of standard input piece by piece, which may refuse the input early.
    """
    if os.fspath(path) == "-":
        source, whole = Source("standard input"), io.BytesIO()
        whole.writelines(blocks(sys.stdin.buffer))
        data = whole.getvalue()
    else:
        source = Source(os.fspath(path), Path(path))
        try:
            mode = os.stat(path).st_mode
            if stat.S_ISDIR(mode):
                raise source.error("this is a directory, not a mesh file")
            if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
                raise source.error("this is a device, not a mesh file")
            data = Path(path).read_bytes()
        except FileNotFoundError:
            raise source.error("no such file") from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise source.error(f"cannot be read ({reason})") from None
        except MemoryError:
            size = os.stat(path).st_size / 1e9
            raise source.error(f"its {size:.1f} GB are more memory than there is") from None
    if not data[:TEXT_START_BYTES].strip() and not data.strip():  # else a copy of gigabytes of text
        raise source.error("the file is empty")
    return data, source


def safe_path(folder: Path, uri: str) -> Path | None:
    """The file that a relative URI names inside a folder; None if it leads anywhere else.

    A name that is there as it stands is taken so: OBJ files write no URIs, and names may hold a ``%``.
    """
    if "%" in uri and (as_it_stands := _inside(folder, uri)) is not None and as_it_stands.is_file():
        return as_it_stands
    return _inside(folder, unquote(uri))


def regular_bytes(path: Path, most: int = -1) -> bytes:
    """The content of a regular file, or its first ``most`` bytes. Raises OSError for anything else.

    A pipe is opened without waiting for a writer, and a device is never read: it may have no end.
    """
    if not path.is_file():
        os.stat(path)  # where nothing is there, its own error
        raise OSError("it is not a regular file")
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with open(handle, "rb") as file:
        if not stat.S_ISREG(os.fstat(handle).st_mode):  # replaced since
            raise OSError("it is not a regular file")
        return file.read(most)


def bytes_beside(folder: Path | None, uri: str, most: int = -1) -> bytes:
    """The content of the regular file that a relative URI names inside a folder, or its first ``most`` bytes.

    Raises OSError if the name leads out of the folder, and for all that is no regular file.
    """
    path = None if folder is None else safe_path(folder, uri)
    if path is None:
        raise OSError("it lies outside the file's folder")
    return regular_bytes(path, most)


def found_beside(folder: Path | None, uri: str) -> Path | None:
    """The file that a relative URI names inside a folder. Files from systems without case may differ in case if
    there is one such file. None if there is none."""
    path = None if folder is None else safe_path(folder, uri)
    if path is None or path.is_file():
        return path
    try:
        alike = [p for p in path.parent.iterdir() if p.name.casefold() == path.name.casefold()]
    except OSError:
        return None
    return min((p for p in alike if p.is_file()), default=None)


def names_in(text: str, folder: Path | None) -> list[str]:
    """The files that an OBJ or MTL line names: one name, perhaps in quotes and with blanks, or several.

    Windows exporters write backslashes; readers everywhere take them for slashes.
    """
    text = text.replace("\\", "/").strip().strip('"')
    several = folder is not None and " " in text and found_beside(folder, text) is None
    return text.split() if several else [text]


def _inside(folder: Path, name: str) -> Path | None:
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", name) or name.startswith(("/", "\\")):
        return None
    name = name.replace("\\", "/")  # as Windows exporters write
    if "\0" in name or ".." in name.split("/"):
        return None
    try:
        # files hold UTF-8; in locales of ASCII the file system calls a name otherwise
        encoding = sys.getfilesystemencoding()
        if encoding != "utf-8" and not name.isascii():
            name = name.encode("utf-8", "surrogateescape").decode(encoding, "surrogateescape")
        path = (folder / name).resolve()
    except UnicodeEncodeError:  # half a character, which no file name has
        return None
    return path if path.is_relative_to(folder.resolve()) else None
