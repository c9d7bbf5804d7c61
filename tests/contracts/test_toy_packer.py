"""A packer is one function and one row: used where it applies, checked on the raster like the others."""

from dataclasses import replace

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.core.registry import Row, Table
from circparam.errors import OptionError
from circparam.packing import PACKERS, Packed, PackOptions, pack
from circparam.packing.placement import Packer, PackTask, Placement
from tests.support.packing import boxes

N = 5
FIVE = boxes(np.ones((N, 2)))
OPTIONS = PackOptions(resolution=256, padding=3, effort=0.01)


def quincunx(task: PackTask) -> Placement:
    """Four squares in the corners and the first on its tip in the middle: the best there is for five."""
    page, border, gap = task.options.resolution, task.options.border, task.options.gap
    side = ((page / 2 - border) * np.sqrt(2) - gap) / (np.sqrt(2) + 0.5)
    low = border + side / 2
    at = np.array([[low, low], [low, page - low], [page - low, low], [page - low, page - low]])
    offset = np.r_[[[page / 2, page / 2]], at]
    return Placement(side, np.array([np.pi / 4, 0, 0, 0, 0]), offset, np.zeros(N, np.int64))


TOY = Row(
    "quincunx", Packer(quincunx, lambda shapes, options: options.rotate == "free"),
    "five squares like the five of a die",
)  # fmt: skip


def is_quincunx(packed: Packed) -> bool:
    centre = packed.uv.reshape(N, 4, 2).mean(1)
    return bool(np.abs(centre[1:] - 0.5).min() > 0.25) and np.allclose(centre[0], 0.5)


def packed_by(
    monkeypatch: pytest.MonkeyPatch,
    *rows: Row[Packer],
    options: PackOptions = OPTIONS,
    **given: object,
) -> Packed:
    """The five squares packed by a table of these rows."""
    monkeypatch.setattr("circparam.packing.table.PACKERS", Table("packer", *rows))
    return pack(*FIVE, options, **given)


def test_one_row_adds_a_packer(monkeypatch: pytest.MonkeyPatch) -> None:
    without = pack(*FIVE, OPTIONS)
    assert not is_quincunx(without)
    packed = packed_by(monkeypatch, *PACKERS, TOY)
    assert is_quincunx(packed)
    assert packed.scale > without.scale
    assert packed.share[0] == pytest.approx(N * packed.scale**2, rel=0.02)


def test_a_packer_runs_where_it_applies_only(monkeypatch: pytest.MonkeyPatch) -> None:
    assert is_quincunx(packed_by(monkeypatch, TOY))
    with pytest.raises(OptionError, match="do not fit"):
        packed_by(monkeypatch, TOY, options=PackOptions(resolution=256, rotate="none"))


@pytest.mark.parametrize("factor", [0.5, 1.1])
def test_a_packer_that_is_looser_or_overlaps_changes_nothing(monkeypatch, factor):
    """Whoever claims the largest scale is looked at first; where charts overlap, the next one is taken."""
    found: list[tuple[list[str], bool]] = []

    def scaled(task: PackTask) -> Placement:
        placement = quincunx(task)
        placement = replace(placement, scale=factor * placement.scale)
        found.append((sorted(task.found), task.sound(placement)))
        return placement

    without = pack(*FIVE, OPTIONS)
    row = Row("scaled", Packer(scaled), "the same, smaller or larger")
    np.testing.assert_array_equal(packed_by(monkeypatch, *PACKERS, row).uv, without.uv)
    assert found == [(["nest", "shelf"], factor < 1)]  # it may start from what others found


def test_only_instant_packers_run_after_the_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    class Over(Monitor):
        @property
        def expired(self) -> bool:
            return True

    instant = Row("quincunx", Packer(quincunx, instant=True), "takes no time")
    assert not is_quincunx(packed_by(monkeypatch, PACKERS["shelf"], TOY, monitor=Over()))
    assert is_quincunx(packed_by(monkeypatch, instant, monitor=Over()))
