"""A cluster that tests share where they are not about starting or losing one."""

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session")
def shared() -> Iterator[str]:
    """The address of the scheduler of a local cluster with two workers."""
    from circparam.batch.cluster import Cluster

    cluster = Cluster(workers=2)
    try:
        yield cluster.client.scheduler.address
    finally:
        cluster.kill()
