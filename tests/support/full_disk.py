"""A disk that fills up while a file is written."""

import errno
import os
from typing import NoReturn

import pytest


def fill_up(monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    """From now on a step of every write raises what the system raises on a full disk."""

    def full(*_: object) -> NoReturn:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, step, full)
