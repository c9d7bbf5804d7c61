"""Ctrl-C and SIGTERM end the work soon, with a code and one line, and no file is left behind."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from circparam.cli import signals

needs_posix = pytest.mark.skipif(os.name != "posix", reason="signals of another kind")

# the work is replaced by something that waits, so that no test depends on speed

WAIT = """
import sys, time, hashlib
from pathlib import Path
from circparam.core import files
from circparam.pipeline import job
def wait(*args):
    left = Path({left!r})
    left.write_text("half a file")
    files.TEMPORARIES.append(left)
    told = False
    {work}
job.repair = wait
sys.argv = ["circparam", "unwrap", {mesh!r}, "-q"]
from circparam.cli import main
main()
"""
READY = 'print("ready", file=sys.stderr, flush=True)'
PYTHON_WORK = f"""{READY}
    time.sleep(600)
"""
# a call that no signal interrupts, as a factorisation is: it releases the interpreter and runs on
NATIVE_WORK = f"""while True:
        try:
            if not told:
                told = True
                {READY}
            hashlib.pbkdf2_hmac('sha256', b'', b'', 2**31 - 1)
        except BaseException:
            pass  # the signal came before the call
"""


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "m.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    return path


@contextlib.contextmanager
def program(code: str) -> Iterator[subprocess.Popen[bytes]]:
    """A program that has said that it is ready."""
    with subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE) as process:
        assert process.stderr.readline() == b"ready\n"
        yield process


@needs_posix
@pytest.mark.parametrize(
    ("name", "code", "work"),
    [
        ("SIGINT", 130, PYTHON_WORK), ("SIGHUP", 143, PYTHON_WORK),
        ("SIGINT", 130, NATIVE_WORK), ("SIGTERM", 143, NATIVE_WORK),
    ],
    ids=["SIGINT", "SIGHUP", "SIGINT in native code", "SIGTERM in native code"],
)  # fmt: skip
def test_signals_end_it_soon_and_clean(name, code, work, mesh):
    left = mesh.parent / ".half.tmp"
    with program(WAIT.format(left=str(left), work=work, mesh=str(mesh))) as process:
        process.send_signal(getattr(signal, name))
        _, error = process.communicate(timeout=30)
    assert process.returncode == code
    assert error.count(b"\n") == 1
    assert error.startswith(b"circparam: error: ")
    assert sorted(p.name for p in mesh.parent.iterdir() if p != left) == ["m.obj"]
    if work is NATIVE_WORK:
        assert not left.exists()


@pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="no such signal")
def test_whoever_asks_is_told_how_far_it_is_and_the_work_goes_on(mesh: Path) -> None:
    """In the middle of a call that no signal interrupts, too."""
    line = r"circparam: status: m\.obj: repair, \d+ % done, \d+ s so far, \d+ MB\n"
    left = str(mesh.parent / ".half.tmp")
    with program(WAIT.format(left=left, work=NATIVE_WORK, mesh=str(mesh))) as process:
        for _ in range(2):
            process.send_signal(signal.SIGUSR1)
            assert re.fullmatch(line, process.stderr.readline().decode())
        assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=30)
    assert process.returncode == 143


def test_handlers_are_those_of_before_afterwards_and_outside_the_main_thread() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    seen = []

    def work() -> None:
        with signals.installed():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    work()
    assert seen[0] is before[1] is not seen[1]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


ASK = """
import sys, time
from circparam.cli import exits, signals
with signals.installed():
    try:
        with signals.asked_first(lambda: print("asked", file=sys.stderr, flush=True)):
            print("ready", file=sys.stderr, flush=True)
            time.sleep(600)
    except exits.Interrupted:
        sys.exit(130)
"""


@needs_posix
def test_the_first_ctrl_c_may_only_ask() -> None:
    with program(ASK) as process:
        process.send_signal(signal.SIGINT)
        assert process.stderr.readline() == b"asked\n"
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(2 * signals.GRACE_SECONDS)  # the watcher leaves it alone as well
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert process.returncode == 130
