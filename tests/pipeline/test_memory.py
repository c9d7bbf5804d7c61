"""A bound on the memory is judged before the work: enough, enough for one process, or not enough."""

import re

import pytest

from circparam.core.monitor import Monitor
from circparam.errors import NoResultError
from circparam.pipeline import memory
from circparam.pipeline.options import Options

FACES = 1_000_000
HELD = 1 << 30


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """A gigabyte is held already; what ends the workers is noted."""
    calls: list[bool] = []
    monkeypatch.setattr(memory, "address_space", lambda: HELD)
    monkeypatch.setattr(memory.workers, "stop", lambda: calls.append(True))
    return calls


def judged(monkeypatch: pytest.MonkeyPatch, limit: float | None, **options: object) -> int:
    """The jobs that are left under such a bound."""
    monkeypatch.setattr(memory, "memory_limit", lambda: limit)
    monitor = Monitor(jobs=2)
    memory.fit_memory("scan.ply", FACES, Options(**options), monitor)
    return monitor.jobs


def test_nothing_changes_where_there_is_enough(monkeypatch, stopped: list[bool]) -> None:
    need = HELD + memory.FACE * FACES
    assert judged(monkeypatch, None) == 2
    assert judged(monkeypatch, 1.34 * need) == 2
    assert not stopped


def test_workers_go_first(monkeypatch, stopped: list[bool]) -> None:
    need = HELD + memory.FACE * FACES
    assert judged(monkeypatch, 1.32 * need) == 1
    assert stopped == [True]
    assert judged(monkeypatch, HELD + 0.66 * memory.FACE * FACES) == 1


def test_what_has_no_chance_is_refused_with_a_size_that_would_do(monkeypatch, stopped) -> None:
    with pytest.raises(NoResultError) as caught:
        judged(monkeypatch, HELD + 0.64 * memory.FACE * FACES)
    said = re.fullmatch(
        r"scan\.ply: 1,000,000 faces take about ([\d.]+) GB, and the bound is [\d.]+ GB: "
        r"give --max-memory ([\d.]+)G or more, or a smaller mesh",
        str(caught.value),
    )
    assert judged(monkeypatch, float(said[2]) * 1e9) == 1
    # the model knows charts alone
    assert judged(monkeypatch, HELD + 1, cut="none") == 2
