"""A process of its own: what goes in, what comes back, what it took."""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam import errors
from circparam.compare import process

HERE = "tests.compare.test_process"


@pytest.fixture(autouse=True)
def _tests_are_importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))


def allocate(
    arrays: dict[str, Any], settings: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    block = np.ones(settings["megabytes"] * 2**17)
    total = float(block.sum())
    del block  # what counts is the peak, not what is left
    return {"twice": 2 * arrays["x"]}, {"total": total, "process": os.getpid()}


def fail(arrays: dict[str, Any], settings: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    raise ValueError("two\nlines")


def die(arrays: dict[str, Any], settings: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    os._exit(9)


def sleep(
    arrays: dict[str, Any], settings: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    import time

    time.sleep(600)
    return {}, {}


def test_arrays_and_values_go_there_and_back() -> None:
    done = process.run(f"{HERE}:allocate", {"x": np.arange(5)}, {"megabytes": 1})
    assert done.error is None
    assert done.arrays["twice"].tolist() == [0, 2, 4, 6, 8]
    assert done.info["total"] == 2**17
    assert done.info["process"] != os.getpid()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux resets the peak")
def test_peak_is_what_the_function_took_and_not_what_the_parent_holds() -> None:
    ballast = np.ones(40 * 2**17)  # the parent's own memory must not count
    small = process.run(f"{HERE}:allocate", {"x": np.arange(5)}, {"megabytes": 8})
    large = process.run(f"{HERE}:allocate", {"x": np.arange(5)}, {"megabytes": 80})
    assert small.peak_bytes is not None
    assert large.peak_bytes is not None
    assert 7.5 * 2**20 <= small.peak_bytes <= 20 * 2**20
    assert 79 * 2**20 <= large.peak_bytes <= 95 * 2**20
    assert ballast[0] == 1


def test_an_exception_is_a_line() -> None:
    done = process.run(f"{HERE}:fail", {}, {})
    assert done.error == "two lines"
    assert done.info == {"kind": "ValueError"}


def test_a_process_that_dies_is_an_error() -> None:
    with pytest.raises(errors.NoResultError, match="code 9"):
        process.run(f"{HERE}:die", {}, {})


def test_a_process_that_hangs_is_ended() -> None:
    with pytest.raises(errors.OutOfTimeError, match="2 seconds"):
        process.run(f"{HERE}:sleep", {}, {}, seconds=2)


def test_no_module_of_the_working_directory_is_picked_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit('shadowed')\n")
    monkeypatch.chdir(tmp_path)
    assert process.run(f"{HERE}:allocate", {"x": np.arange(2)}, {"megabytes": 1}).error is None
