"""A process of its own: what goes in, what comes back, what it took."""

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam import errors
from circparam.core import own_process

HERE = "tests.core.test_own_process"
Answer = tuple[dict[str, Any], dict[str, Any]]


@pytest.fixture(autouse=True)
def _tests_are_importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))


def allocate(arrays: dict[str, Any], settings: dict[str, Any]) -> Answer:
    block = np.ones(settings["megabytes"] * 2**17)
    total = float(block.sum())
    del block  # what counts is the peak, not what is left
    print("this is no part of the answer")
    return {"twice": 2 * arrays["x"]}, {"total": total, "process": os.getpid()}


def harm(arrays: dict[str, Any], settings: dict[str, Any]) -> Answer:
    if settings["how"] == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if settings["how"] == "sleep":
        time.sleep(600)
    raise ValueError("two\nlines")


def test_arrays_and_values_go_there_and_back(tmp_path, monkeypatch):
    """And no module of the working directory is picked up."""
    (tmp_path / "json.py").write_text("raise SystemExit('shadowed')\n")
    monkeypatch.chdir(tmp_path)
    done = own_process.run(f"{HERE}:allocate", {"x": np.arange(5)}, {"megabytes": 1})
    assert done.error is None
    assert done.arrays["twice"].tolist() == [0, 2, 4, 6, 8]
    assert done.info["total"] == 2**17
    assert done.info["process"] != os.getpid()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux resets the peak")
def test_peak_is_what_the_function_took_and_not_what_the_parent_holds() -> None:
    ballast = np.ones(40 * 2**17)
    for megabytes, least, most in ((8, 7.5, 20), (80, 79, 95)):
        done = own_process.run(f"{HERE}:allocate", {"x": np.arange(5)}, {"megabytes": megabytes})
        assert least * 2**20 <= done.peak_bytes <= most * 2**20
    assert ballast[0] == 1


def test_a_function_that_fails_dies_or_hangs() -> None:
    done = own_process.run(f"{HERE}:harm", {}, {"how": "raise"})
    assert (done.error, done.info) == ("two lines", {"kind": "ValueError"})
    with pytest.raises(errors.NoResultError, match="code -9"):
        own_process.run(f"{HERE}:harm", {}, {"how": "die"})
    with pytest.raises(errors.OutOfTimeError, match=r"0\.5 seconds"):
        own_process.run(f"{HERE}:harm", {}, {"how": "sleep"}, seconds=0.5)
