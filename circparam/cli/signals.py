"""Ctrl-C, SIGTERM and SIGHUP: an exception in the main thread, and an end within a second whatever it is doing.

Python delivers a signal between bytecodes, and a sparse factorisation of a large mesh is a single one that may
take many seconds. The interpreter therefore also writes each signal to a pipe, which a watching thread reads.
If the main thread has not ended shortly after, the watcher removes the temporary files and ends the process.
The same thread answers SIGUSR1 (where it exists) at once, with a line of progress on stderr.
"""

import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TypeVar

from circparam.cli.exits import INTERRUPTED, TERMINATED, Interrupted, Terminated

T = TypeVar("T")
GRACE_SECONDS = 0.7  # seconds that the main thread has to clean up by itself
# the same, within a block of a command that has processes and folders to clear away
GRACES: list[float] = []

# replacement for the first Ctrl-C, once: one list for the main thread, one for the watcher
_ASKED: list[Callable[[], None]] = []
_SPARED: list[int] = []
# the progress of the work in one line, as SIGUSR1 prints it
STATUS: list[Callable[[], str]] = []
ASK: signal.Signals | None = getattr(signal, "SIGUSR1", None)
HANGUP: signal.Signals | None = getattr(signal, "SIGHUP", None)  # the terminal has closed


def _interrupt(number: int, frame: FrameType | None) -> None:
    if _ASKED:
        _ASKED.pop()()
        return
    raise Interrupted


@contextlib.contextmanager
def within(known: list[T], value: T) -> Iterator[None]:
    """Within the block a list has one more value, unless the value is taken out."""
    known.append(value)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):
            known.remove(value)


@contextlib.contextmanager
def asked_first(ask: Callable[[], None]) -> Iterator[None]:
    """Within the block the first Ctrl-C only calls ``ask``; the second one ends the work as usual."""
    with within(_SPARED, int(signal.SIGINT)), within(_ASKED, ask):
        yield


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated


@contextlib.contextmanager
def installed() -> Iterator[None]:
    """Handle signals that end the work inside the block; does nothing outside the main thread.

    SIGHUP stays ignored where it is, as under nohup.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers: dict[signal.Signals, Callable[[int, FrameType | None], None]] = {
        signal.SIGTERM: _terminate,
        signal.SIGINT: _interrupt,
    }
    if HANGUP is not None and signal.getsignal(HANGUP) is signal.SIG_DFL:
        handlers[HANGUP] = _terminate
    if ASK is not None:
        handlers[ASK] = lambda number, frame: None
    old = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    old_fd = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    done = threading.Event()
    watcher = threading.Thread(target=_watch, args=(reader, done), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        signal.set_wakeup_fd(old_fd)
        for number, handler in old.items():
            signal.signal(number, handler)
        writer.close()
        watcher.join(1.0)
        reader.close()


def _watch(reader: socket.socket, done: threading.Event) -> None:
    """Wait for a signal number; end the process where the main thread is still busy after the grace."""
    while True:
        try:
            data = reader.recv(1)
        except OSError:
            return
        if not data:
            return
        if data[0] == ASK:  # one line past all buffers
            line = STATUS[-1]() if STATUS else "no stage has begun yet"
            with contextlib.suppress(OSError):
                os.write(2, f"circparam: status: {line}\n".encode())
        elif data[0] in _SPARED:
            _SPARED.remove(data[0])
        elif data[0] in (signal.SIGINT, signal.SIGTERM, HANGUP):
            break
    if done.wait(max([GRACE_SECONDS, *GRACES])):
        return
    # files of an interrupted write, if any was begun
    for path in tuple(getattr(sys.modules.get("circparam.core.files"), "TEMPORARIES", ())):
        with contextlib.suppress(OSError):
            os.unlink(path)
    interrupted = data[0] == signal.SIGINT
    word = "interrupted" if interrupted else "terminated"
    with contextlib.suppress(OSError):
        os.write(2, f"circparam: error: {word}: no partial file is left behind\n".encode())
    os._exit(INTERRUPTED if interrupted else TERMINATED)
