"""A whole batch: list, check, continue from the manifest, run on a cluster, tell. ``run_batch`` is the door."""

import contextlib
import glob
import json
import os
import shutil
import tempfile
import time
import uuid
from collections.abc import Callable
from dataclasses import field, replace
from typing import Any

from circparam.batch.cluster import Cluster, LostError
from circparam.batch.index import Index, size_of
from circparam.batch.manifest import NAME, Manifest, local_copy, read_lines
from circparam.batch.progress import Meter, Progress
from circparam.batch.report import save_report
from circparam.batch.run import Batch, BatchPlan, Hooks, Listener
from circparam.batch.settings import Settings
from circparam.batch.sources import Listing
from circparam.batch.store import Folder, open_store
from circparam.batch.task import WORK_FOLDER
from circparam.core.records import dataclass
from circparam.errors import InputError, NoResultError, OptionError

STATUS = f"{WORK_FOLDER}/status.json"
REMOTE_STATUS_SECONDS = 30.0  # seconds between two notes of the state in a remote folder


@dataclass(frozen=True)
class Summary:
    """How a batch ended. total: files of the sources; counts: files by status in the manifest at the end;
    missed: with a gate missed; done: in this run; finished: whether nothing is left to do. codes: exit code →
    files. report: address of the page, None if none was written."""

    total: int
    counts: dict[str, int]
    missed: int
    done: int
    skipped: int
    finished: bool
    seconds: float
    codes: dict[str, int] = field(default_factory=dict)
    report: str | None = None

    @property
    def fail_rate(self) -> float:
        """Share of the files that failed or missed a gate."""
        done = sum(self.counts.values())
        return (self.counts.get("failed", 0) + self.missed) / done if done else 0.0


def run_batch(plan: BatchPlan, hooks: Hooks | None = None) -> Summary:
    """Unwrap all files of the sources that the manifest does not have as done.

    Raises OptionError for results that collide and for a scheduler or worker that does not fit. Raises
    InputError for missing sources, OutputError for a folder that cannot be written, NoResultError if the
    scheduler ended.
    """
    hooks = hooks or Hooks()
    start = time.monotonic()
    folder = Folder(plan.settings.out)
    settings = replace(plan.settings, out=folder.address, run=uuid.uuid4().hex[:12])
    plan = replace(plan, settings=settings)
    with Index() as index:
        listing = Listing(plan.sources, None if folder.remote else folder.address)
        total = index.add_sources(listing, folder)
        for pattern in settings.extras.values():
            index.check_further(pattern)
        if listing.own:
            hooks.note(f"{listing.own} files named *_uv.* are results of unwrap: they are left out")
        if not total:
            raise InputError(
                f"{' '.join(plan.sources)}: no mesh files are there; name a folder, glob or list that has some"
            )
        folder.make()
        exists = _existing(folder)
        _check_owned(folder, index, exists, settings)
        manifest = Manifest(folder)
        try:
            _clean(folder)
            if manifest.mended:
                hooks.note(f"{NAME}: its incomplete last line ({manifest.mended} bytes) is removed")
            index.add_lines(read_lines(manifest.path))
            due = index.mark_due(settings.key(), plan.retry, exists)
            meter = Meter(total, total - due, index.weight())
            finished = True
            if due:
                finished = _work(plan, index, manifest, meter, hooks)
            index.add_lines(read_lines(manifest.path))
            report: str | None = folder.of("report.html")
            if due or folder.remote or not os.path.exists(str(report)):
                report = save_report(folder, index)
        finally:
            _clean(folder)
            manifest.close()
        counts, codes, missed = index.counts(of_sources=True)
        seconds = time.monotonic() - start
        return Summary(
            meter.total, counts, missed, meter.done, meter.skipped, finished, seconds, codes, report
        )


def _existing(folder: Folder) -> Callable[[str, int], bool]:
    """Whether a result (name, bytes or −1) is there."""
    sizes = folder.sizes() if folder.remote else None

    def exists(name: str, size: int) -> bool:
        found = size_of(folder.of(name)) if sizes is None else sizes.get(name, -1)
        return found >= 0 and size in (-1, found)

    return exists


def _check_owned(
    folder: Folder, index: Index, exists: Callable[[str, int], bool], settings: Settings
) -> None:
    """Refuse to write over other files: a folder with a manifest belongs to a batch."""
    if settings.options.overwrite or exists(NAME, -1):
        return
    found = index.existing(exists)
    if found is not None:
        raise OptionError(
            f"{folder.of(found)} exists and no batch has written there: give --overwrite, or another --out"
        )


def _work(plan: BatchPlan, index: Index, manifest: Manifest, meter: Meter, hooks: Hooks) -> bool:
    """Run the items that are due; whether all are done."""
    folder = manifest.folder
    hooks = replace(hooks, listener=_StatusFile(folder, hooks.listener))
    work = None if folder.remote else folder.of(WORK_FOLDER)
    cluster = Cluster(plan.workers, plan.scheduler, plan.scheduler_file, work)
    try:
        batch = Batch(cluster, index.items(), plan, hooks, manifest, meter)
        with hooks.started(batch.ask_to_stop):
            finished = batch.run()
    except LostError:
        cluster.kill()
        where = plan.scheduler or plan.scheduler_file or "this machine"
        left = meter.total - meter.skipped - meter.done
        raise NoResultError(
            f"the scheduler of {where} has ended with {left} files not done: give the same command again"
        ) from None
    except BaseException:
        cluster.kill()
        raise
    cluster.close()
    return finished


class _StatusFile:
    """Passes progress on, and keeps it under --out for ``--status``."""

    def __init__(self, folder: Folder, listener: Listener) -> None:
        self.folder, self.listener = folder, listener
        self.last = -REMOTE_STATUS_SECONDS
        if not folder.remote:
            os.makedirs(folder.of(WORK_FOLDER), exist_ok=True)

    def __call__(self, progress: Progress) -> None:
        now = time.monotonic()
        if not self.folder.remote or now - self.last >= REMOTE_STATUS_SECONDS:
            self.last = now
            known = {**progress.as_dict(), "pid": os.getpid(), "time": time.time()}
            with contextlib.suppress(Exception):  # it only informs
                self.folder.put_bytes(STATUS, json.dumps(known).encode(), durable=False)
        self.listener(progress)


def _clean(folder: Folder) -> None:
    """Remove temporary files of an earlier run, and of this one."""
    if not folder.remote:
        shutil.rmtree(folder.of(WORK_FOLDER), ignore_errors=True)
        return
    with contextlib.suppress(Exception):
        store, root = open_store(folder.address)
        store.rm_file(f"{root}/{STATUS}")
    for left in glob.glob(os.path.join(tempfile.gettempdir(), "circparam-batch-*-*")):
        if os.path.isdir(left) and time.time() - os.path.getmtime(left) > 86400:
            shutil.rmtree(left, ignore_errors=True)


def status(out: str) -> dict[str, Any]:
    """The state of a folder from its manifest, and the progress of a running batch, if there is one.

    Raises OptionError if there is no manifest.
    """
    folder = Folder(out)
    path, _ = local_copy(folder)
    if not path.exists():
        raise OptionError(f"{folder.address}: it has no {NAME}: no batch has written there")
    with Index() as index:
        index.add_lines(read_lines(path))
        counts, _, missed = index.counts()
    live: dict[str, Any] | None = None
    with contextlib.suppress(ValueError):
        live = json.loads(folder.get_bytes(STATUS) or b"null")
    stale = 10.0 if not folder.remote else 4 * REMOTE_STATUS_SECONDS
    if live is not None and time.time() - float(live.get("time", 0)) > stale:
        live = None
    return {
        "schema": "circparam/batch-status/1",
        "out": folder.address,
        "lines": sum(counts.values()),
        "counts": counts,
        "missed": missed,
        "running": live is not None,
        "run": live,
    }
