"""Sources of a batch: files, folders, globs, lists and remote addresses, listed one by one.

Every file has a name relative to its source, with ``/``: the tree under the source, mirrored under --out. The
name of a single file is the last part of its path. A file found by a glob is named by the path behind the part
without wildcards. A file of a list is named by its path in the list.
"""

import codecs
import functools
import glob
import itertools
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from circparam.batch.store import again, archive_of, etag, is_remote, local_path, open_store
from circparam.core.records import dataclass
from circparam.errors import InputError, OptionError

_WILD = re.compile(r"[*?\[]")
_ANY_FOLDERS = re.compile(r"(?<![^/\\])(?:\*\*[/\\]+)*\*\*(?:[/\\]+|$)")  # **/, also several
OWN_OUTPUT = re.compile(r"_uv\.[^./]+$")  # an output of ``unwrap`` beside its source


@dataclass(frozen=True)
class SourceFile:
    """One file to unwrap.

    address: absolute path or remote address. name: of the file relative to its source, with ``/``. size: bytes,
    0 if unknown. mark: changes when the file does (time of change, etag).
    """

    address: str
    name: str
    size: int = 0
    mark: str = ""


class Listing:
    """An iterator over the files of sources; own results that were left out are counted in ``own``.

    sources: as the command line has them. out: local folder of the results, which is no source where it lies in
    one. Raises InputError if a source is missing, unreadable or has no file that it names.
    """

    def __init__(self, sources: Sequence[str], out: str | None = None) -> None:
        self.sources, self.own = sources, 0
        self.out = None if out is None else os.path.realpath(out)

    def __iter__(self) -> Iterator[SourceFile]:
        for source in self.sources:
            for found in self._one(source):
                if OWN_OUTPUT.search(found.name):
                    self.own += 1
                else:
                    yield found

    def _one(self, source: str) -> Iterator[SourceFile]:
        if source.startswith("@"):
            for line in list_lines(source[1:]):
                prefix = re.sub(r"^(?:[A-Za-z][A-Za-z0-9+.-]+://|[/\\]+|[A-Za-z]:[/\\]*)", "", line)
                prefix = "/".join(p for p in re.split(r"[/\\]", prefix) if p not in ("", "."))
                if ".." in prefix.split("/"):
                    raise InputError(
                        f"{source}: {line!r} leads out of the folder by '..': write the whole path"
                    )
                yield from self._plain(line, prefix)
        else:
            yield from self._plain(source, None)

    def _plain(self, source: str, prefix: str | None) -> Iterator[SourceFile]:
        """prefix: the name that a list gives; None for a source of the command line."""
        if is_remote(source):
            yield from _remote(source, prefix)
            return
        path = local_path(source)
        if os.path.isdir(path):
            yield from self._folder(path, f"{prefix}/" if prefix else "")
        elif os.path.lexists(path):
            yield _local(path, prefix or os.path.basename(path))
        elif _WILD.search(path):
            yield from self._glob(path)
        else:
            raise InputError(f"{source}: no such file or folder")

    def _folder(self, top: str, prefix: str) -> Iterator[SourceFile]:
        """All mesh files below a folder; hidden names and linked folders are left out."""
        known, waiting = suffixes(), [(top, prefix)]
        while waiting:
            folder, before = waiting.pop()
            try:
                entries = os.scandir(folder)
            except OSError as error:
                raise InputError(f"{folder}: cannot be read ({error.strerror})") from None
            with entries:
                for entry in entries:
                    if entry.name.startswith("."):
                        continue
                    if entry.is_dir(follow_symlinks=False):
                        if os.path.realpath(entry.path) != self.out:
                            waiting.append((entry.path, f"{before}{entry.name}/"))
                    elif _suffix(entry.name) in known and entry.is_file():
                        yield _local(entry.path, before + entry.name, entry.stat())

    def _glob(self, pattern: str) -> Iterator[SourceFile]:
        start = _WILD.search(pattern)
        base = os.path.dirname(pattern[: start.start()]) if start else ""
        known, found = suffixes(), False
        paths: Iterable[str] = _matches(pattern)
        if len(_ANY_FOLDERS.findall(pattern)) > 1:  # a/**/b/**/c names c more than once
            paths = dict.fromkeys(paths)
        for path in paths:
            real = os.path.realpath(path)
            inside = self.out is not None and real.startswith(self.out + os.sep)
            if _suffix(path) in known and os.path.isfile(path) and not inside:
                found = True
                yield _local(path, os.path.relpath(path, base or ".").replace(os.sep, "/"))
        if not found:
            raise InputError(f"{pattern}: no mesh file has a name of that form")


def _matches(pattern: str) -> Iterator[str]:
    """The paths of a glob; ``**`` goes into no linked folder, which may lead back to one above."""
    found = _ANY_FOLDERS.search(pattern)
    if found is None:
        yield from glob.iglob(pattern)
        return
    for top in glob.iglob(pattern[: found.start()] or os.curdir):
        for folder, below, _ in os.walk(top):
            below[:] = [name for name in below if not name.startswith(".")]
            yield from _matches(os.path.join(glob.escape(folder), pattern[found.end() :] or "*"))


def list_lines(path: str) -> Iterator[str]:
    """The addresses of a list, one a line, or between NUL bytes where there are any; ``#`` begins a comment.

    Raises InputError if it cannot be read.
    """
    try:
        with open(path, "rb") as stream:
            head = stream.read(1 << 16)
            stream.seek(len(codecs.BOM_UTF8) if head.startswith(codecs.BOM_UTF8) else 0)
            mark = b"\0" if b"\0" in head else b"\n"
            for piece in _pieces(iter(functools.partial(stream.read, 1 << 16), b""), mark):
                line = os.fsdecode(piece if mark == b"\0" else piece.rstrip(b"\r"))
                if line and (mark == b"\0" or (line.strip() and not line.startswith("#"))):
                    yield line
    except OSError as error:
        raise InputError(f"@{path}: the list cannot be read ({error.strerror})") from None


def _pieces(blocks: Iterator[bytes], mark: bytes) -> Iterator[bytes]:
    rest = b""
    for block in blocks:
        *whole, rest = (rest + block).split(mark)
        yield from whole
    yield rest


def _local(path: str, name: str, known: os.stat_result | None = None) -> SourceFile:
    try:
        stat = known or os.stat(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    address = os.path.join(_real_folder(os.path.dirname(path)), os.path.basename(path))
    return SourceFile(address, name, stat.st_size, str(stat.st_mtime_ns))


@functools.lru_cache(maxsize=4096)
def _real_folder(folder: str) -> str:
    return os.path.realpath(folder or ".")


def _remote(address: str, prefix: str | None) -> Iterator[SourceFile]:
    """The files of a remote address: a file, a folder or a glob."""
    store, path = open_store(address)
    tail = archive_of(address)
    wild = _WILD.search(path)
    try:
        if wild is not None and not address.startswith("http"):
            base = path[: wild.start()].rpartition("/")[0]
            found: Iterable[Any] = again(store.glob, path, detail=True).items()
        else:
            info = again(store.info, path)
            if info.get("type") == "directory":
                base, found = path.rstrip("/"), _walk(store, path)
            else:
                base, found = path.rpartition("/")[0], [(path, info)]
        known, any_file = suffixes(), False
        for place, info in found:
            if info.get("type") == "directory" or _suffix(place) not in known:
                continue
            any_file = True
            name = place[len(base) :].lstrip("/") or place.rpartition("/")[2]
            if prefix is not None:
                name = prefix if _suffix(prefix) in known else f"{prefix}/{name}"
            inner = f"{address.split('://')[0]}://{place}{tail}"
            whole = inner if tail else str(store.unstrip_protocol(place))
            yield SourceFile(whole, name, int(info.get("size") or 0), etag(info))
        if not any_file:
            raise InputError(f"{address}: no mesh file is there")
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{address}: there is no such file or folder") from None
    except (InputError, OptionError):
        raise
    except Exception as error:
        raise InputError(
            f"{address}: cannot be listed ({type(error).__name__}: {' '.join(str(error).split())})"
        ) from None


def _walk(store: Any, path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Folder by folder, so only one of them is in memory."""
    waiting = [path]
    while waiting:
        folder = waiting.pop()
        for info in again(store.ls, folder, detail=True):
            name = str(info["name"])
            if name.rstrip("/") == folder.rstrip("/") or name.rpartition("/")[2].startswith("."):
                continue
            if info.get("type") == "directory":
                waiting.append(name)
            else:
                yield name, info


@functools.lru_cache(maxsize=1)
def suffixes() -> frozenset[str]:
    """How the names of mesh files end, in lower case."""
    from circparam.formats.table import FORMATS

    return frozenset(itertools.chain(*(row.function.suffixes for row in FORMATS)))


def output_name(name: str) -> str:
    """The name of the result of a file: its own; with another suffix where its format has no place for uv.

    Raises OptionError if the suffix is none of a mesh format.
    """
    from circparam.formats.table import output_suffix

    if _suffix(name) not in suffixes():
        known = ", ".join(sorted(suffixes()))
        raise OptionError(f"{name}: the suffix names no mesh format; give one of {known}")
    head, _, last = name.rpartition("/")
    stem, suffix = os.path.splitext(last)
    return f"{head}{'/' if head else ''}{stem}{output_suffix(suffix)}"


def _suffix(name: str) -> str:
    return os.path.splitext(name)[1].lower()
