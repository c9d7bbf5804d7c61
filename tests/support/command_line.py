"""The command line in this process, and small files for it."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner, Result

from circparam.cli import cli
from tests.support import writers

QUICK = ("--effort", "0.01")  # the search for a better packing is tested elsewhere
CONVEX = ("--cut", "none", "--method", "mean-value", *QUICK)


def run(*words: object, **keywords: Any) -> Result:
    """The result of a command line."""
    return CliRunner().invoke(cli, [str(word) for word in words], **keywords)


def done(*words: object, **keywords: Any) -> Result:
    """The result of a command line that must go well."""
    result = run(*words, **keywords)
    assert result.exit_code == 0, result.stderr
    return result


def report(*words: object) -> dict[str, Any]:
    """The document that a command prints with --json; it must go well."""
    return json.loads(done(*words, "--json").stdout)


def one_line_error(result: Result, code: int, *words: str) -> None:
    """The documented code, one line on stderr that says what and where, no traceback."""
    assert result.exit_code == code, (result.exit_code, result.stderr, result.exception)
    lines = [line for line in result.stderr.splitlines() if "warning" not in line]
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("circparam: error: ")
    for word in words:
        assert word in lines[0], lines[0]
    assert "Traceback" not in result.output


def obj(path: Path, shape: tuple[np.ndarray, np.ndarray], uv: np.ndarray | None = None) -> Path:
    """An OBJ file of points and faces; uv: of each point."""
    path.write_bytes(writers.obj(*shape, uv))
    return path


class Terminal(io.StringIO):
    """What is written to a terminal."""

    def isatty(self) -> bool:
        """It is one."""
        return True
