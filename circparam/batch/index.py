"""Items of a batch: all files of the sources with their state in the manifest, in a temporary data base.

The data base lies on the disk, so ten million files take no more memory than ten. The end of the run deletes
the data base, because the manifest is the truth and the index only orders its lines.
"""

import itertools
import os
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from circparam.batch.settings import PLACE
from circparam.batch.sources import SourceFile, output_name
from circparam.batch.store import Folder, digest
from circparam.core.records import dataclass
from circparam.errors import OptionError

BLOCK_ROWS = 5000  # rows that are written together
STORED_FIGURES = (
    *("charts", "seam_length", "distortion", "distortion_max_chart", "stretch_p99", "share_over_2"),
    *("pack", "faces", "seconds", "peak_memory", "attempts"),
)
_TABLES = f"""
PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA temp_store = FILE; PRAGMA cache_size = -20000;
CREATE TABLE file (id INTEGER PRIMARY KEY, source BLOB, target BLOB UNIQUE, path BLOB, size INTEGER,
                   mark TEXT, due INTEGER DEFAULT 0);
CREATE TABLE done (name BLOB PRIMARY KEY, source BLOB, size INTEGER, mark TEXT, hash TEXT, options TEXT,
                   status TEXT, exit INTEGER, output_bytes INTEGER, cause BLOB, stage TEXT,
                   {", ".join(f"{name} REAL" for name in STORED_FIGURES)});
"""


@dataclass(frozen=True)
class Item:
    """A file to do. target: name of its result under --out."""

    number: int
    source: str
    target: str
    size: int
    mark: str
    attempt: int = 1

    @property
    def line(self) -> dict[str, Any]:
        """What a line of the manifest says of the file."""
        source = {"source": self.source, "source_bytes": self.size, "source_mark": self.mark}
        return {"name": self.target, **source}


class Index:
    """The files of a batch and the last line that the manifest has of each; a context that removes it."""

    def __init__(self) -> None:
        self.data = sqlite3.connect("")  # a file without a name, gone with the process
        self.data.executescript(_TABLES)

    def __enter__(self) -> "Index":
        return self

    def __exit__(self, *_: object) -> None:
        self.data.close()

    def add_lines(self, found: Iterable[dict[str, Any]]) -> None:
        """Fold the lines of a manifest: the last one of each name counts."""
        marks = ",".join("?" * (11 + len(STORED_FIGURES)))
        for rows in _blocks(map(_row, found)):
            self.data.executemany(f"INSERT OR REPLACE INTO done VALUES ({marks})", rows)
        self.data.commit()

    def add_sources(self, found: Iterable[SourceFile], folder: Folder) -> int:
        """Add all files of the sources; returns their number. A file that is named twice counts once.

        Raises OptionError if a result would overwrite another one, or a source.
        """
        out = None if folder.remote else os.path.realpath(folder.address)
        for block in _blocks(found):
            rows = []
            for s in block:
                target = output_name(s.name)
                path = folder.of(target) if out is None else os.path.join(out, target)
                rows.append((_key(s.address), _key(target), _key(path), s.size, s.mark))
            before = self.data.total_changes
            self.data.executemany(
                "INSERT OR IGNORE INTO file (source, target, path, size, mark) VALUES (?,?,?,?,?)",
                rows,
            )
            if self.data.total_changes - before < len(rows):
                self._check_same(rows)
        self.data.execute("CREATE INDEX source_of ON file (source)")
        hit = self.data.execute(
            "SELECT a.source, b.source FROM file a JOIN file b ON b.source = a.path LIMIT 1"
        ).fetchone()
        if hit is not None:
            what = "itself" if hit[0] == hit[1] else f"the source {_text(hit[1])}"
            raise OptionError(f"{_text(hit[0])} would overwrite {what}: give another --out")
        (n,) = self.data.execute("SELECT count(*) FROM file").fetchone()
        return int(n)

    def _check_same(self, rows: list[tuple[Any, ...]]) -> None:
        for source, target, *_ in rows:
            (other,) = self.data.execute(
                "SELECT source FROM file WHERE target = ?", (target,)
            ).fetchone()
            if other != source:
                raise OptionError(
                    f"{_text(other)} and {_text(source)} would both be written to {_text(target)}: "
                    "give them two folders of results"
                )

    def check_further(self, pattern: str) -> None:
        """Raise OptionError if two files would write one further file; the pattern has ``{}`` for the stem."""
        self.data.create_function(
            "stem", 1, lambda name: os.path.splitext(name)[0], deterministic=True
        )
        hit = self.data.execute(
            "SELECT min(source), max(source), stem(target) AS its FROM file GROUP BY its "
            "HAVING count(*) > 1 LIMIT 1"
        ).fetchone()
        if hit is not None:
            place = pattern.replace(PLACE, _text(hit[2]))
            raise OptionError(
                f"{_text(hit[0])} and {_text(hit[1])} would both write {place}: "
                "give them two folders of results"
            )

    def counts(self, of_sources: bool = False) -> tuple[dict[str, int], dict[str, int], int]:
        """(files by status, files by exit code, those with a gate missed), by the last lines of the manifest.

        of_sources: without files that are in no source.
        """
        inner = "JOIN file f ON d.name = f.target" if of_sources else ""
        query = f"SELECT d.status, d.exit, count(*) FROM done d {inner} GROUP BY 1, 2"
        by_status, by_code, missed = Counter[str](), Counter[str](), 0
        for status, code, n in self.data.execute(query):
            by_status[status] += n
            by_code[str(code)] += n
            missed += n if status != "failed" and code else 0
        return dict(by_status), dict(by_code), missed

    def mark_due(
        self, options: str, retry: frozenset[str], exists: Callable[[str, int], bool]
    ) -> int:
        """Decide which files are due; returns their number.

        options: hash of the options and version. retry: of failed, degraded, all. exists: whether a result
        (name, bytes) is still there. Done and unchanged is left: same options, same source, result there.
        """

        def is_due(row: tuple[Any, ...]) -> bool:
            _, source, target, size, mark, *done = row
            old_size, old_mark, hashed, made_with, status, code, out = done
            if status is None or made_with != options or "all" in retry:
                return True
            if "failed" in retry and (status == "failed" or code):
                return True
            if "degraded" in retry and status == "degraded":
                return True
            if (size, mark) != (old_size, old_mark):
                path = _text(source)
                same = size == old_size and (hashed or "").startswith("sha256:")
                if not same or not os.path.isfile(path) or digest(path) != hashed:
                    return True
            return status != "failed" and not exists(_text(target), out or -1)

        query = (
            "SELECT f.id, f.source, f.target, f.size, f.mark, d.size, d.mark, d.hash, d.options, d.status, "
            "d.exit, d.output_bytes FROM file f LEFT JOIN done d ON d.name = f.target"
        )
        due = [row[:1] for row in self.data.execute(query) if is_due(row)]
        self.data.executemany("UPDATE file SET due = 1 WHERE id = ?", due)
        self.data.commit()
        return len(due)

    def weight(self) -> int:
        """Bytes of all files that are due."""
        (n,) = self.data.execute("SELECT coalesce(sum(size), 0) FROM file WHERE due").fetchone()
        return int(n)

    def existing(self, exists: Callable[[str, int], bool]) -> str | None:
        """The first result that is there already; None if there is none."""
        for (target,) in self.data.execute("SELECT target FROM file ORDER BY id"):
            if exists(_text(target), -1):
                return _text(target)
        return None

    def items(self) -> Iterator[Item]:
        """The files that are due, the largest first."""
        query = "SELECT id, source, target, size, mark FROM file WHERE due ORDER BY size DESC, id"
        for number, source, target, size, mark in self.data.execute(query):
            yield Item(number, _text(source), _text(target), size, mark)


def _row(line: dict[str, Any]) -> tuple[Any, ...]:
    measures = line.get("measures") or {}
    figures = [line.get(name, measures.get(name)) for name in STORED_FIGURES]
    reasons, stages = line.get("reasons") or [""], line.get("stages") or {}
    cause = str(line.get("error") or reasons[0])  # of a failed or degraded file, in one line
    slowest = max(stages, key=lambda k: stages[k], default="")
    return (
        _key(line["name"]), _key(str(line.get("source"))), line.get("source_bytes"),
        line.get("source_mark"), line.get("source_hash"), line.get("options"), line.get("status"),
        line.get("exit"), line.get("output_bytes"), _key(cause),
        f"{slowest}: {stages[slowest]:.3g} s" if slowest else "", *figures,
    )  # fmt: skip


def _blocks(found: Iterable[Any]) -> Iterator[list[Any]]:
    iterator = iter(found)
    while block := list(itertools.islice(iterator, BLOCK_ROWS)):
        yield block


def _key(text: str) -> bytes:
    """A name as bytes: SQLite takes no text that is not UTF-8."""
    return text.encode("utf-8", "surrogateescape")


def _text(key: bytes) -> str:
    return key.decode("utf-8", "surrogateescape")


def size_of(path: str | os.PathLike[str]) -> int:
    """Bytes of a file, −1 if there is none."""
    try:
        return Path(path).stat().st_size
    except OSError:
        return -1
