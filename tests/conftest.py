"""Shared fixtures: where the real meshes are, and reproducible random numbers."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

# One profile for all tests. No deadline and no complaint about slow examples: how long one takes says how busy
# the machine is, not whether the code is right.
settings.register_profile(
    "circparam", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.load_profile("circparam")


def corpus_folder() -> Path:
    """The folder of real meshes, whether it exists or not."""
    default = Path(__file__).resolve().parents[1] / ".." / "shared" / "meshes"
    return Path(os.environ.get("CIRCPARAM_CORPUS", default)).resolve()


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real meshes; the test is skipped, saying why, where it is absent."""
    folder = corpus_folder()
    if not (folder / "MANIFEST.tsv").is_file():
        pytest.skip("the folder of real meshes is absent: set CIRCPARAM_CORPUS to run this")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run and every order of tests."""
    return np.random.default_rng(20190607)
