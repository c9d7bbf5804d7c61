"""The manifest: one line of JSON a file, appended, never rewritten.

A line that a crash or a full disk has torn is cut off before anything else is appended. A remote folder cannot
append. Lines go to a journal on this machine, and the whole journal is put into the folder from time to time
and at the end.
"""

import contextlib
import hashlib
import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from circparam.batch.store import Folder
from circparam.errors import OptionError, OutputError

NAME = "manifest.jsonl"
SCHEMA = "circparam/batch/1"
SYNC_SECONDS = 2.0  # seconds between two calls that make the lines durable on the disk
# seconds between two uploads at least; they take at most a twentieth of the time
UPLOAD_SECONDS = 30.0


def encode_line(line: dict[str, Any]) -> bytes:
    """One line. ASCII alone: names that are no UTF-8, or hold a newline, survive as escapes."""
    return json.dumps(line, ensure_ascii=True, separators=(",", ":")).encode() + b"\n"


def read_lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of a manifest, in order; torn lines and other lines that are no JSON object with a name are
    skipped."""
    with contextlib.suppress(FileNotFoundError), path.open("rb") as stream:
        for text in stream:
            if not text.endswith(b"\n"):
                return
            with contextlib.suppress(ValueError):
                line = json.loads(text)
                if isinstance(line, dict) and isinstance(line.get("name"), str):
                    yield line


def cut_torn_line(path: Path) -> int:
    """Cut off a torn last line; returns its number of bytes. Raises OSError."""
    if not path.exists():
        return 0
    with path.open("rb+") as stream:
        end = stream.seek(0, os.SEEK_END)
        keep = end
        while keep > 0:
            start = max(0, keep - 65536)
            stream.seek(start)
            found = stream.read(keep - start).rfind(b"\n")
            if found >= 0:
                keep = start + found + 1
                break
            keep = start
        if keep < end:
            stream.truncate(keep)
    return end - keep


class Manifest:
    """The manifest of a folder, open for appending; one process at a time has it.

    ``path``: where its lines are on this machine. Raises OptionError where another batch has it, OutputError if
    it cannot be written.
    """

    def __init__(self, folder: Folder) -> None:
        self.folder = folder
        try:
            self.path, there = local_copy(folder)
            fresh = folder.remote and not there
            if fresh:  # of another folder of that name
                self.path.unlink(missing_ok=True)
            self._stream = self.path.open("ab", buffering=0)
            self._lock()
            self.mended = cut_torn_line(self.path)
            self._end = self._stream.seek(0, os.SEEK_END)
        except OSError as error:
            raise OutputError(
                f"{self.path}: the manifest cannot be written ({error.strerror or error})"
            ) from None
        except OptionError:
            self._stream.close()
            raise
        self._synced = self._uploaded = time.monotonic()
        self._pause = UPLOAD_SECONDS
        if fresh:
            self.upload()

    def _lock(self) -> None:
        try:
            import fcntl
        except ImportError:  # not on Windows: nothing keeps two batches apart there
            return
        try:
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OptionError(
                f"{self.folder.address}: another batch is at work there; see circparam batch --status"
            ) from None

    def append(self, line: dict[str, Any]) -> None:
        """One more line, whole or not at all. Raises OSError if the disk refuses; nothing is torn then."""
        data = encode_line(line)
        written = 0
        try:
            while written < len(data):
                written += self._stream.write(data[written:])
        except OSError:
            self._stream.truncate(self._end)
            raise
        self._end += len(data)
        now = time.monotonic()
        if now - self._synced > SYNC_SECONDS:
            self._synced = now
            os.fsync(self._stream.fileno())
        if self.folder.remote and now - self._uploaded > self._pause:
            # the journal has the lines; later, then
            with contextlib.suppress(OSError, OutputError):
                self.upload()

    def upload(self) -> None:
        """Put the journal into the remote folder. Raises OutputError if the store refuses."""
        start = time.monotonic()
        try:
            self.folder.put(NAME, str(self.path))
        except OutputError as error:
            raise OutputError(
                f"{error}; its lines are kept in {self.path}: the same command again puts them there"
            ) from None
        finally:
            self._uploaded = time.monotonic()
            self._pause = max(UPLOAD_SECONDS, 20 * (self._uploaded - start))

    def close(self) -> None:
        """Make it durable, and put it into the remote folder."""
        if self._stream.closed:
            return
        try:
            with contextlib.suppress(OSError):
                os.fsync(self._stream.fileno())
            if self.folder.remote:
                self.upload()
        finally:
            self._stream.close()


def journal(folder: Folder) -> Path:
    """Where the lines of a remote folder are kept on this machine."""
    base = os.environ.get("XDG_STATE_HOME") or os.path.join(
        os.path.expanduser("~"), ".local", "state"
    )
    key = hashlib.sha256(folder.address.encode("utf-8", "surrogatepass")).hexdigest()[:16]
    return Path(base) / "circparam" / "batch" / f"{key}.jsonl"


def local_copy(folder: Folder) -> tuple[Path, bool]:
    """(where the lines of a folder are on this machine, whether the folder has a manifest).

    Of a remote folder that is the journal, which gets the remote manifest: the longer of the two contains the
    other.
    """
    if not folder.remote:
        path = Path(folder.of(NAME))
        return path, path.exists()
    path, data = journal(folder), folder.get_bytes(NAME)
    path.parent.mkdir(parents=True, exist_ok=True)
    if data is not None and (not path.exists() or path.stat().st_size < len(data)):
        path.write_bytes(data)
    return path, data is not None
