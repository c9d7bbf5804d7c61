"""The list of temporary files, which cli/signals knows by the name of this module only."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from circparam.cli import signals
from circparam.core import files


def test_temporary_files_of_a_write_under_way_are_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Found through ``sys.modules``, by a string: it fails where the module or its list is called otherwise."""
    left, gone, other = tmp_path / "half.tmp", tmp_path / "gone.tmp", tmp_path / "whole.obj"
    left.write_text("half a file")
    other.write_text("a file")
    monkeypatch.setattr(files, "TEMPORARIES", [gone, left])
    signals._remove_temporaries()
    assert [p.name for p in tmp_path.iterdir()] == ["whole.obj"]


def test_signals_do_not_import_what_writes_files() -> None:
    """The reason for the string: to handle a signal nothing is loaded that the work did not need."""
    code = "import sys, circparam.cli.signals as s; s._remove_temporaries(); print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "circparam.core.files" not in run.stdout.split()
