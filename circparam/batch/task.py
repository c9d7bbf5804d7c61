"""The work on one file: fetch it with the files beside it that it needs, have it unwrapped, put the results in
place, report.

Nothing is raised: every outcome is a line of the manifest. The line has ``again`` if another attempt may end
otherwise (a store that refuses, a full disk, a process that was ended).
"""

import contextlib
import errno
import json
import os
import re
import shutil
import signal
import socket
import tempfile
import time
from pathlib import Path
from typing import Any

from circparam._version import __version__
from circparam.batch.index import Item, size_of
from circparam.batch.manifest import SCHEMA
from circparam.batch.process import GoneError, warm_server
from circparam.batch.settings import Settings, settings_of
from circparam.batch.store import Folder, again, archive_of, digest, is_remote, open_store
from circparam.errors import CircparamError, InputError, OutputError
from circparam.formats.obj.materials import image_names
from circparam.formats.source import safe_path

WORK_FOLDER = ".circparam-batch"  # folder under --out that exists while a batch runs
_FULL = (errno.ENOSPC, errno.EDQUOT)
_FULL_TEXT = tuple(os.strerror(number) for number in _FULL)
_NOT_ITS_FAULT = (9, 15)  # SIGKILL and SIGTERM come from outside
# keys of a report with a place of their own in a line, or none
_ELSEWHERE = {
    *("schema", "version", "input", "output", "files", "format", "method", "cut", "options"),
    *("repaired", "seconds"),
}
_KEPT = ("status", "reasons", "warnings", "repairs", "notes", "stages")
_LEFT: set[str] = set()  # runs that begin nothing more in this process
_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.+?)[ \t\r]*$", re.M)


def leave(run: str) -> None:
    """Called in every worker when a run is asked to stop: tasks begun from now on are left."""
    _LEFT.add(run)


def do_item(settings_data: bytes, item: Item) -> dict[str, Any]:
    """The task that is submitted: a line for the manifest, or that the file was left (see ``leave``)."""
    settings = settings_of(settings_data)
    if settings is None:
        return {"refused": __version__, "name": item.target}
    if settings.run in _LEFT:
        return {"left": settings.run, "name": item.target}
    start = time.time()
    scratch = None
    line: dict[str, Any] = {
        "schema": SCHEMA,
        **item.line,
        "source_hash": None,
        "options": settings.key(),
        "version": settings.version,
        "worker": f"{socket.gethostname()}:{os.getpid()}",
        "attempts": item.attempt,
    }
    try:
        scratch = _scratch(settings, item)
        line |= _unwrap(settings, item, scratch)
    except Exception as error:
        line |= _failed(settings, error)
    finally:
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)
    line.setdefault("output", None)
    line["finished"] = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    line["turnaround"] = round(time.time() - start, 4)
    return line


def _scratch(settings: Settings, item: Item) -> str:
    """A new folder for one file, on the disk of local results, so that a rename is enough."""
    if is_remote(settings.out):
        return tempfile.mkdtemp(prefix=f"circparam-batch-{settings.run}-")
    folder = os.path.join(settings.out, WORK_FOLDER, settings.run)
    os.makedirs(folder, exist_ok=True)
    return tempfile.mkdtemp(prefix=f"{item.number}-", dir=folder)


def _unwrap(settings: Settings, item: Item, scratch: str) -> dict[str, Any]:
    folder = Folder(settings.out)
    place, _, last = item.target.rpartition("/")
    # notes name the folder of the result: its last part is that of the real one
    inner = os.path.join(scratch, os.path.basename(place or folder.address) or "out")
    os.mkdir(inner)
    target = os.path.join(inner, last)
    if is_remote(item.source):
        source, mark = fetch(item.source, os.path.join(scratch, "source"), settings)
    else:
        source, mark = item.source, None
        if os.path.isfile(source):
            with contextlib.suppress(OSError):
                mark = digest(source)
    out = {"source_hash": f"etag:{item.mark}" if is_remote(item.source) and item.mark else mark}
    task = {
        "settings": settings,
        "source": source,
        "target": target,
        "name": item.target,
        "scratch": scratch,
    }
    with warm_server(settings.forks) as server:
        end = server.ask(task, settings.hard_stop, settings.max_memory)
    said = _answered(settings, end)
    files, further = said.pop("files"), said.pop("further")
    real = folder.of(item.target)
    names = {target: real, inner: os.path.dirname(real), source: item.source}
    out |= {**_renamed(said, names), "output": None}
    if files:
        out |= _placed(folder, item, inner, files, further)
    return out


def _placed(
    folder: Folder, item: Item, inner: str, files: list[str], further: dict[str, str]
) -> dict[str, Any]:
    """Put the files in place, the result last; returns their entries for the line."""
    target = os.path.join(inner, files[-1])
    output = {"output_bytes": size_of(target), "output_hash": digest(target)}
    base = item.target.rpartition("/")[0]
    names = [(os.path.join(inner, f), name) for name, f in further.items()]
    names += [
        (os.path.join(inner, f), f"{base}/{f}".lstrip("/").replace(os.sep, "/")) for f in files
    ]
    for path, name in names:
        folder.put(name, path)
    more = [name for _, name in names[:-1]]
    return {"output": folder.of(item.target), **output, **({"files": more} if more else {})}


def _answered(settings: Settings, end: dict[str, Any]) -> dict[str, Any]:
    """The answer of a warm server for a mesh, as part of a line; its files under 'files' and 'further'."""
    out: dict[str, Any] = {
        "status": "failed", "exit": 1, "error": None, "seconds": round(end["seconds"], 4),
        "peak_memory": end["peak"], "files": [], "further": {},
    }  # fmt: skip
    answer = end["answer"]
    if answer is None:
        return out | _cut_short(settings, end)
    out |= {"exit": answer["code"], "error": answer["error"]}
    if "trace" in answer:
        out["trace"] = answer["trace"]
    report = answer["report"]
    if report is None:
        full = answer["code"] == 8 and any(text in (answer["error"] or "") for text in _FULL_TEXT)
        return out | ({"again": "space"} if full else {})
    measures = {k: v for k, v in report.items() if k not in _ELSEWHERE and k not in _KEPT}
    out |= {**{k: report[k] for k in _KEPT}, "measures": measures}
    return out | {k: answer[k] for k in ("files", "further")}


def _cut_short(settings: Settings, end: dict[str, Any]) -> dict[str, Any]:
    """A mesh whose process did not answer: exit code, line, and whether it may be tried again."""
    if end["end"] == "timeout":
        stop = settings.hard_stop or 0.0
        text = f"ended after {stop:g} s, 1.5 x --timeout, while it did not answer: give a longer --timeout"
        return {"exit": 7, "error": text}
    if end["end"] == "memory":
        size = (settings.max_memory or 0) / 2**20
        return {"exit": 5, "error": f"ended at {size:.0f} MB of memory: give a larger --max-memory"}
    number = int(end.get("signal", 0))
    names = {int(known): known.name for known in signal.Signals}
    name = names.get(number, f"signal {number}") if number else "no word"
    said = f": {end['said']}" if end.get("said") else ""
    if number in _NOT_ITS_FAULT:
        text = (
            f"its process was ended by {name}, perhaps because memory was short: give --max-memory"
        )
        return {"exit": 5, "error": text + said, "again": "ended"}
    text = f"its process crashed ({name}){said}: please report it with the file"
    return {"exit": 1, "error": text}


def _failed(settings: Settings, error: Exception) -> dict[str, Any]:
    """An error round the unwrap: of a store, a disk, a warm server."""
    cause = error.__cause__ or error
    again = None
    if isinstance(error, GoneError):
        code, line, again = 5, "the process that unwraps was ended from outside", "ended"
    else:
        code, line = settings.exit_of(error)
        full = isinstance(cause, OSError) and cause.errno in _FULL
        of_store = isinstance(error, (OutputError, OSError))
        if full:
            code, again = 8, "space"
        elif of_store or (isinstance(error, InputError) and error.__cause__):
            again = "store"
    out = {"status": "failed", "seconds": None, "peak_memory": None, "exit": code, "error": line}
    return out | ({"again": again} if again else {})


def _renamed(values: Any, names: dict[str, str]) -> Any:
    """The same values with the paths of the scratch folder replaced by those of the user."""
    if isinstance(values, str):
        for old, new in names.items():
            values = values.replace(old, new)
        return values
    if isinstance(values, dict):
        return {k: _renamed(v, names) for k, v in values.items()}
    if isinstance(values, list):
        return [_renamed(v, names) for v in values]
    return values


def fetch(address: str, folder: str, settings: Settings) -> tuple[str, str | None]:
    """Download a file into a folder: (its local path, hash of its bytes).

    Its companions come along: buffers of a glTF, with --copy-assets or --rebake images and materials too.
    Raises InputError, with the cause kept where it was the store.
    """
    os.makedirs(folder)
    inner = address.removesuffix(archive_of(address))
    path = os.path.join(folder, inner.rpartition("/")[2] or "source")
    try:
        store, remote = open_store(address)
        again(store.get_file, remote, path)
        everything = bool(settings.options.copy_assets) or settings.look is not None

        def fetched(name: str) -> Path | None:
            """The local copy of a file beside the source; reading the mesh reports a missing one."""
            beside = f"{remote.rpartition('/')[0]}/{name}"
            local = safe_path(Path(folder), name)
            if local is None:
                return None
            local.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(FileNotFoundError):
                again(store.get_file, beside.lstrip("/" if archive_of(address) else ""), str(local))
            return local if local.is_file() else None

        beside = [fetched(name) for name in _companions(path, everything)]
        for library in [p for p in beside if p is not None and p.suffix.lower() == ".mtl"]:
            for name in image_names(_readable(library.read_bytes())):
                for word in dict.fromkeys((name, name.split()[-1])):  # it may follow others
                    fetched(word)
    except CircparamError:
        raise
    except FileNotFoundError:
        raise InputError(f"{address}: no such file") from None
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        raise InputError(f"{address}: cannot be fetched ({' '.join(text.split())})") from error
    return path, digest(path)


def _companions(path: str, all_of_them: bool) -> list[str]:
    """Relative names of the files that a file refers to."""
    suffix = os.path.splitext(path)[1].lower()
    if suffix == ".gltf":
        with contextlib.suppress(ValueError, OSError):
            tree = json.loads(Path(path).read_bytes())
            found = []
            for kind in ("buffers", "images") if all_of_them else ("buffers",):
                rows = tree.get(kind) if isinstance(tree, dict) else None
                for row in rows if isinstance(rows, list) else []:
                    uri = row.get("uri") if isinstance(row, dict) else None
                    if isinstance(uri, str) and not uri.startswith("data:"):
                        found.append(uri)
            return found
    if suffix == ".obj" and all_of_them:
        return [_readable(name) for name in _LIBRARY.findall(Path(path).read_bytes())]
    return []


def _readable(data: bytes) -> str:
    """Text with the slashes that readers everywhere take the backslashes of Windows exporters for."""
    return data.decode("utf-8", "surrogateescape").replace("\\", "/")
