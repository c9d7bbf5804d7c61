"""A disk that fills up while a file is written."""

import errno
import os
from typing import NoReturn

import pytest

STEPS = ("fsync", "replace")  # the calls of a write that may fail, each on a disk that is full


def fill_up(monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    """From now on a step of every write raises what the system raises on a full disk."""

    def full(*_: object) -> NoReturn:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, step, full)
