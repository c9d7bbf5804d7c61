"""Processes that a test has started."""

import os
import subprocess
import sys
from pathlib import Path

from circparam.core.pool import Pool

ROOT = Path(__file__).parents[2]


def pids(pool: Pool) -> list[int]:
    """The processes of a pool."""
    return list(pool.executor._processes)


def printed(code: str, *words: object, **env: str) -> str:
    """What a fresh interpreter prints that runs some code with these words and variables; it must go well."""
    command = [sys.executable, "-c", code, *map(str, words)]
    how = {"cwd": ROOT, "env": os.environ | env, "capture_output": True, "text": True}
    done = subprocess.run(command, check=False, timeout=300, **how)
    assert done.returncode == 0, done.stderr
    return done.stdout
