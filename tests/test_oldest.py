"""The oldest versions that pyproject.toml allows: stated for all, and tried by make test-oldest."""

import os
import subprocess
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.tools.oldest import constraints

ROOT = Path(__file__).parents[1]


def _numbers(text: str) -> list[int]:
    return [int(part) for part in text.split(".") if part.isdecimal()]


def test_every_package_has_a_floor_that_is_met_here() -> None:
    for name, floor in (line.split("==") for line in constraints()):
        assert _numbers(version(name)) >= _numbers(floor), name


def test_packages_without_a_floor_are_found() -> None:
    for bad in ('"numpy"', '"numpy<3"', '"numpy==1.26"'):
        project = f"[project]\ndependencies = [{bad}]\n[project.optional-dependencies]\n"
        with pytest.raises(ValueError, match="numpy"):
            constraints(project + "baseline = []\nbatch = []\nformats = []\nusd = []\n")


@pytest.mark.slow
@pytest.mark.skipif("CIRCPARAM_SLOW" not in os.environ, reason="it builds an environment: minutes")
def test_formats_and_batches_work_with_the_oldest_versions() -> None:
    done = subprocess.run(
        ["make", "test-oldest"], cwd=ROOT, check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
