"""Processes that a test has started."""

import subprocess

import pytest

from circparam.core.pool import Pool


def noted_processes(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """A list to which every process is added that is started from now on."""
    started: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def noted(*given: object, **rest: object) -> subprocess.Popen[bytes]:
        started.append(popen(*given, **rest))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", noted)
    return started


def pids(pool: Pool) -> list[int]:
    """The processes of a pool."""
    return list(pool.executor._processes)
