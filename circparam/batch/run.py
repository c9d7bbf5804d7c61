"""The batch itself. A bounded window of tasks is at Dask, and lines enter the manifest as they come. Errors
that may pass lead to new attempts. Another run can continue after any end."""

import contextlib
import heapq
import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from typing import Any

from circparam.batch.cluster import Cluster, LostError, refuse
from circparam.batch.index import Item
from circparam.batch.manifest import Manifest
from circparam.batch.progress import Meter, Progress
from circparam.batch.settings import Settings, pack_settings
from circparam.batch.task import do_item, leave
from circparam.core.records import dataclass
from circparam.errors import OutputError

WINDOW_TASKS = 4  # tasks at Dask for each that can be at work
MOST_ATTEMPTS = 5  # of a file whose worker, process or store failed
PAUSE_SECONDS = 0.5  # seconds before a second attempt; twice as long before each further one
# seconds that a full disk may stay full with nothing done before files count as failed
FULL_DISK_SECONDS = 600.0
LOOK_SECONDS = 1.0  # seconds between two looks at the running tasks
POLL_SECONDS = 0.01
LAST_SECONDS = 3.0  # seconds for running tasks after the batch was asked to stop

Listener = Callable[[Progress], None]
Task = Callable[[bytes, Item], dict[str, Any]]


@dataclass(frozen=True)
class BatchPlan:
    """The task of a batch. sources: as the command line has them. retry: of failed, degraded, all. workers: of
    a cluster on this machine; scheduler, scheduler_file: of one that runs. task: function that a worker calls
    for one item. last: seconds for running tasks after the batch was asked to stop."""

    sources: Sequence[str]
    settings: Settings
    retry: frozenset[str] = frozenset()
    workers: int | None = None
    scheduler: str | None = None
    scheduler_file: str | None = None
    task: Task = do_item
    last: float = LAST_SECONDS


@dataclass(frozen=True)
class Hooks:
    """Callbacks of the caller. listener: called with the progress, about once a second. on_line: called with
    each final line. note: called for sources left out. started: gets the function that asks the batch to stop;
    a context, within which it works.
    """

    listener: Listener = field(default=lambda _: None)
    on_line: Callable[[dict[str, Any]], None] = field(default=lambda _: None)
    note: Callable[[str], None] = field(default=lambda _: None)
    started: Callable[[Callable[[], None]], contextlib.AbstractContextManager[None]] = field(
        default=lambda _: contextlib.nullcontext()
    )


@dataclass
class Batch:
    """One run. items: to do, in this order. ``ask_to_stop`` lets short tasks finish; ``run`` then returns
    False."""

    cluster: Cluster
    items: Iterator[Item]
    plan: BatchPlan
    hooks: Hooks
    manifest: Manifest
    meter: Meter
    stopping: bool = False
    running: dict[Any, tuple[Any, Item]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        from distributed import as_completed

        client = self.cluster.client
        self._ready = as_completed([], with_results=True, raise_errors=False, loop=client.loop)
        self._later: list[tuple[float, int, Item]] = []  # heap of items for another attempt
        self._unwritten: list[dict[str, Any]] = []  # lines that the disk had no room for
        self._number = itertools.count()
        self._looked, self._threads = 0.0, 0
        self._full_since: float | None = None
        self._note = ""
        self._packed = pack_settings(self.plan.settings)

    def ask_to_stop(self) -> None:
        """Let running tasks finish soon, and start no others (from a signal handler, or another thread)."""
        self.stopping = True

    def run(self) -> bool:
        """Until all is done (True), or it was asked to stop.

        Raises LostError if the scheduler is gone, OutputError if the manifest cannot be written,
        OptionError for a worker of another version.
        """
        end = math.inf
        while True:
            if self.stopping and end == math.inf:
                end = time.monotonic() + self.plan.last
                self._later.clear()
                self._looked = -math.inf  # look now
            self._look()
            more = not self.stopping and (self._fill() or bool(self._later))
            if not self.running and not self._unwritten and not more:
                return not self.stopping
            if time.monotonic() > end:  # the next run does the tasks that were left
                return False
            self._write()
            if self._ready.has_ready():
                for future, result in self._ready.next_batch(block=False):
                    self._take(future, result)
            else:
                time.sleep(POLL_SECONDS)

    def _fill(self) -> bool:
        """Submit up to the window; whether there may be more."""
        now = time.monotonic()
        room = 1 if self._full_since is not None else WINDOW_TASKS * max(self._threads, 1)
        while len(self.running) < room and not self._unwritten:
            item: Item | None
            if self._later and self._later[0][0] <= now:
                item = heapq.heappop(self._later)[2]
            elif self._full_since is not None and self._later:
                return True
            else:
                item = next(self.items, None)
            if item is None:
                return False
            # one group for all: Dask keeps data of each group while any of its tasks runs
            key = "unwrap", next(self._number)
            future = self.cluster.client.submit(
                self.plan.task, self._packed, item, key=key, pure=False, retries=0
            )
            self.running[key] = (future, item)
            self._ready.add(future)
        return True

    def _take(self, future: Any, line: Any) -> None:
        """Record the answer of one task."""
        entry = self.running.pop(future.key, None)
        if entry is None:
            return
        item = entry[1]
        if future.status != "finished" or not isinstance(line, dict):
            self._no_answer(future, item, line)
            return
        if "refused" in line:
            refuse(str(line.get("worker", "that took a file")), line["refused"])
        if "left" in line:
            return
        again = line.pop("again", None)
        if again == "space":
            # the disk is full: one file at a time until there is room, without counting the attempts
            now = time.monotonic()
            self._full_since = self._full_since or now
            if now - self._full_since > FULL_DISK_SECONDS:
                self._final(line)
            elif not self.stopping:
                self._note = "the disk is full: waiting for room"
                heapq.heappush(self._later, (now + 2 * PAUSE_SECONDS, next(self._number), item))
            return
        self._full_since, self._note = None, ""
        if again is not None and self._try_again(item):
            return
        self._final(line)

    def _no_answer(self, future: Any, item: Item, found: Any) -> None:
        """The worker ended while it had the task, or could not read it."""
        if future.status in ("cancelled", "lost"):
            if not self.stopping and not self.cluster.alive:
                raise LostError
            if not self.stopping:
                self._try_again(replace(item, attempt=item.attempt - 1))
            return
        if self._try_again(item):
            return
        cause = found[1] if isinstance(found, tuple) and len(found) > 1 else found
        text = " ".join(f"{type(cause).__name__}: {cause}".split())[:500]
        line = {
            **item.line, "status": "failed", "exit": 1, "output": None,
            "attempts": item.attempt, "error": f"its worker ended {item.attempt} times: {text}",
        }  # fmt: skip
        self._final(line)

    def _try_again(self, item: Item) -> bool:
        """Put a file back for a later attempt; False if it had all of them."""
        if item.attempt >= MOST_ATTEMPTS or self.stopping:
            return self.stopping  # no line now: the next run does it
        ready = time.monotonic() + PAUSE_SECONDS * 2 ** (item.attempt - 1)
        heapq.heappush(
            self._later, (ready, next(self._number), replace(item, attempt=item.attempt + 1))
        )
        return True

    def _final(self, line: dict[str, Any]) -> None:
        self._unwritten.append(line)
        self._write()

    def _write(self) -> None:
        """Append the lines that wait; where the disk is full they wait on, and nothing new is begun."""
        while self._unwritten:
            try:
                self.manifest.append(self._unwritten[0])
            except OSError as error:
                now = time.monotonic()
                self._full_since = self._full_since or now
                if self.stopping or now - self._full_since > FULL_DISK_SECONDS:
                    raise OutputError(
                        f"{self.manifest.path}: cannot be written ({error.strerror}): "
                        "the same command again does the files without a line"
                    ) from None
                self._note = f"the manifest cannot be written ({error.strerror}): waiting"
                time.sleep(PAUSE_SECONDS)
                return
            line = self._unwritten.pop(0)
            self.meter.count(line)
            self.hooks.on_line(line)

    def _look(self) -> None:
        """A periodic look at the number of workers, the running tasks and the scheduler.

        After ``ask_to_stop`` the look tells each worker, also workers that joined later, to begin nothing more.
        Each task still answers with a line, or with the word that it was left. Only a worker knows which tasks
        it has begun. The scheduler hears later, and the line of a cancelled task would be lost.
        """
        now = time.monotonic()
        if now - self._looked < LOOK_SECONDS:
            return
        self._looked = now
        if not self.cluster.alive:
            raise LostError
        try:
            self._threads = self.cluster.threads()
            if self.stopping:
                self.cluster.client.run(leave, self.plan.settings.run, on_error="ignore")
                if not self._threads:  # no worker answers, so no task is running
                    self.cluster.client.cancel([future for future, _ in self.running.values()])
                    self.running.clear()
            ages = self.cluster.running()
        except Exception:
            if not self.cluster.alive:
                raise LostError from None
            return
        known = {k: seconds for k, seconds in ages.items() if k in self.running}
        note = self._note or ("" if self._threads else "there are no workers yet: waiting")
        names = {self.running[k][1].target: seconds for k, seconds in known.items()}
        self.hooks.listener(self.meter.progress(names, self._threads, note))
