"""Shared fixtures: where the real meshes are, and reproducible random numbers."""

import logging
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from circparam.core import workers
from tests.support.clock import Clock
from tests.support.corpus import CORPUS

# One profile for all tests. No deadline and no complaint about slow examples: how long one takes says how busy
# the machine is, not whether the code is right. 50 examples: other ones in every run.
settings.register_profile(
    "circparam",
    deadline=None,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
    print_blob=True,
)
settings.load_profile("circparam")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave out what takes minutes, unless it is asked for."""
    if not os.environ.get("CIRCPARAM_SLOW"):
        skip = pytest.mark.skip(reason="takes minutes: make bench-batch runs it (CIRCPARAM_SLOW=1)")
        for item in items:
            if item.get_closest_marker("slow"):
                item.add_marker(skip)


def pytest_sessionfinish() -> None:
    """End the worker processes while the modules are there that loky needs for it."""
    workers.stop()


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real meshes; the test is skipped, saying why, where it is absent."""
    if not (CORPUS / "MANIFEST.tsv").is_file():
        pytest.skip("the folder of real meshes is absent: set CIRCPARAM_CORPUS to run this")
    return CORPUS


@pytest.fixture
def no_workers_left() -> Iterator[None]:
    """Ends the worker processes behind each test."""
    yield
    workers.stop()


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run and every order of tests."""
    return np.random.default_rng(20190607)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """A clock that stands still unless the test turns it."""
    return Clock(monkeypatch)


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a scheduler with two workers, each a process, for tests that neither start nor end one."""
    import dask
    from distributed import LocalCluster

    quiet = {"dashboard_address": "127.0.0.1:0", "silence_logs": logging.CRITICAL}
    with (
        dask.config.set({"temporary-directory": str(tmp_path_factory.mktemp("dask"))}),
        LocalCluster(2, threads_per_worker=1, **quiet) as cluster,
    ):
        yield cluster.scheduler_address
