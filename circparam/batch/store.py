"""Where files lie: a folder of this machine, or an address of fsspec (``s3://``, ``gs://``, ``zip://`` ...).

Local files are never handled by fsspec. A remote call is tried again some times, since stores refuse calls now
and then; a file is put there whole or not at all.
"""

import contextlib
import hashlib
import os
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from circparam.core.files import write_files
from circparam.errors import InputError, OptionError, OutputError

T = TypeVar("T")

CALL_TRIES = 6  # calls of a remote store before it counts as failed
FIRST_PAUSE_SECONDS = 0.1  # seconds before the second call; twice as long before each further one
BATCH_EXTRA = "it needs the extra: pip install 'circparam[batch]'"
# parts that other calls do not change
FINAL_ERRORS = (
    FileNotFoundError,
    PermissionError,
    IsADirectoryError,
    NotADirectoryError,
    ImportError,
)


def is_remote(address: str) -> bool:
    """Whether an address is one for fsspec. A drive letter is no scheme, and ``file://`` is local."""
    scheme = re.match(r"([A-Za-z][A-Za-z0-9+.-]+)://", address)
    return scheme is not None and scheme[1].lower() not in ("file", "local")


def local_path(address: str) -> str:
    """The path of a local address, without ``file://``."""
    return re.sub(r"^(file|local)://", "", address)


def chained(address: str) -> str:
    """An address as fsspec chains addresses: the path inside an archive first, then the archive.

    ``zip://a.zip::*.glb`` (the archive first) is taken as ``zip://*.glb::a.zip``.
    """
    match = re.fullmatch(r"(zip|tar)://(.+?\.(?:zip|tar|tgz|tar\.\w+))::([^:]+)", address, re.I)
    if match is None or re.search(r"\.(zip|tar|tgz)$", match[3], re.I):
        return address
    return f"{match[1]}://{match[3]}::{match[2]}"


def archive_of(address: str) -> str:
    """The archive behind ``::`` in an address, a local one by its whole path; '' for none."""
    _, mark, rest = chained(address).partition("::")
    return mark + (rest if "://" in rest or not rest else os.path.abspath(rest))


def open_store(address: str) -> tuple[Any, str]:
    """(file system of fsspec, path in it). Raises OptionError if fsspec or a driver is missing."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise OptionError(f"{address}: {BATCH_EXTRA}") from None
    try:
        store, path = url_to_fs(chained(address), use_listings_cache=False)
    except ImportError as error:
        raise OptionError(f"{address}: {' '.join(str(error).split())}") from None
    except (ValueError, OSError) as error:
        raise InputError(f"{address}: cannot be opened ({' '.join(str(error).split())})") from None
    return store, str(path)


def again(call: Callable[..., T], *args: Any, **keywords: Any) -> T:
    """A call of a remote store, repeated where it fails; the last error is raised."""
    for k in range(CALL_TRIES - 1):
        try:
            return call(*args, **keywords)
        except FINAL_ERRORS:
            raise
        except Exception:
            time.sleep(FIRST_PAUSE_SECONDS * 2**k)
    return call(*args, **keywords)


def etag(info: dict[str, Any]) -> str:
    """A value that changes with a remote file, from the data of its store; '' without one."""
    for name in ("ETag", "etag", "md5Hash", "CRC", "checksum", "LastModified", "mtime", "created"):
        if info.get(name):
            return str(info[name]).strip('"')
    return ""


class Folder:
    """The folder of the outputs, local or remote: names are relative, with ``/``."""

    def __init__(self, address: str) -> None:
        self.remote = is_remote(address)
        self.address = address.rstrip("/") if self.remote else os.path.abspath(local_path(address))

    def of(self, name: str) -> str:
        """The address of a file in it."""
        return f"{self.address}/{name}" if self.remote else os.path.join(self.address, name)

    def make(self) -> None:
        """Make the folder and try that it can be written. Raises OutputError."""
        if self.remote:
            return
        try:
            os.makedirs(self.address, exist_ok=True)
            with tempfile.TemporaryFile(dir=self.address):
                pass
        except OSError as error:
            raise OutputError(
                f"{self.address}: cannot be written ({error.strerror}): give another --out"
            ) from None

    def put(self, name: str, path: str) -> None:
        """Put a local file there, whole: moved where the folder is local. Raises OutputError."""
        with self._writing(name):
            if self.remote:
                store, root = open_store(self.address)
                again(store.put_file, path, f"{root}/{name}")
            else:
                target = self.of(name)
                os.makedirs(os.path.dirname(target), exist_ok=True)
                os.replace(path, target)

    def put_bytes(self, name: str, data: bytes, durable: bool = True) -> None:
        """Put a small file there, whole; ``durable``: as for ``write_files``. Raises OutputError."""
        if not self.remote:
            write_files({Path(self.of(name)): data}, overwrite=True, durable=durable)
            return
        with self._writing(name):
            store, root = open_store(self.address)
            again(store.pipe_file, f"{root}/{name}", data)

    @contextlib.contextmanager
    def _writing(self, name: str) -> Iterator[None]:
        """Raise the errors of a disk or a store as OutputError, caused by them."""
        try:
            yield
        except Exception as error:
            reason = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
            line = f"{self.of(name)}: cannot be written ({' '.join(reason.split())})"
            raise OutputError(line) from error

    def get_bytes(self, name: str) -> bytes | None:
        """The content of a file in it; None if there is none."""
        try:
            if not self.remote:
                return Path(self.of(name)).read_bytes()
            store, root = open_store(self.address)
            return again(store.cat_file, f"{root}/{name}")
        except FileNotFoundError:
            return None

    def sizes(self) -> dict[str, int]:
        """Name → bytes of all files of a remote folder, in one listing."""
        store, root = open_store(self.address)
        try:
            found = again(store.find, root, detail=True)
        except FileNotFoundError:
            return {}
        start = len(root.rstrip("/")) + 1
        return {path[start:]: int(info.get("size") or 0) for path, info in found.items()}


def digest(path: str | os.PathLike[str]) -> str:
    """``sha256:`` and the hash of a file's bytes."""
    with open(path, "rb") as stream:
        return f"sha256:{hashlib.file_digest(stream, 'sha256').hexdigest()}"
