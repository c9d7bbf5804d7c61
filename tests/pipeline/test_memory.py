"""A bound on the memory is judged before the work: enough, enough for one process, or not enough."""

import re

import pytest

from circparam.core.memory import address_space
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError
from circparam.pipeline import jobs as memory
from circparam.pipeline.options import Options

FACES = 1_000_000


def judged(monkeypatch: pytest.MonkeyPatch, limit: float | None, **options: object) -> int:
    """The jobs that are left under such a bound."""
    monkeypatch.setattr(memory, "memory_limit", lambda: limit)
    monitor = Monitor(jobs=2)
    memory.fit_memory("scan.ply", FACES, Options(**options), monitor)
    return monitor.jobs


def test_workers_go_before_the_work_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    held, need = address_space(), memory.UNWRAP_FACE_BYTES * FACES
    enough = 4 / 3 * (held + need)  # for a worker too, which gets a quarter
    for limit, jobs in ((None, 2), (1.02 * enough, 2), (0.98 * enough, 1), (held + 0.7 * need, 1)):
        assert judged(monkeypatch, limit) == jobs


def test_what_has_no_chance_is_refused_with_a_size_that_would_do(monkeypatch):
    with pytest.raises(NoResultError) as caught:
        judged(monkeypatch, address_space() + 0.6 * memory.UNWRAP_FACE_BYTES * FACES)
    said = re.fullmatch(
        r"scan\.ply: 1,000,000 faces take about ([\d.]+) GB, and the bound is [\d.]+ GB: "
        r"give --max-memory ([\d.]+)G or more, or a smaller mesh",
        str(caught.value),
    )
    assert judged(monkeypatch, float(said[2]) * 1e9) == 1
    # the model knows charts alone
    assert judged(monkeypatch, 1.0, cut="none") == 2
