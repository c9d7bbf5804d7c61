"""A packer is one function and one row: used where it applies, checked on the raster like the others."""

from dataclasses import replace

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.core.registry import Row, Table
from circparam.errors import OptionError
from circparam.packing import PACKERS, Packed, PackOptions, pack
from circparam.packing.outlines import shapes_of
from circparam.packing.pack import finish
from circparam.packing.placement import Packer, PackTask, Placement

N = 5
OPTIONS = PackOptions(resolution=256, padding=3, effort=0.02)


def squares(n: int = N) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit squares, a chart each: (faces, uv, chart)."""
    corner = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    uv = np.concatenate([corner + np.array([2.0 * c, 0]) for c in range(n)])
    return np.concatenate([faces + 4 * c for c in range(n)]), uv, np.repeat(np.arange(n), 2)


def quincunx(task: PackTask) -> Placement:
    """Four squares in the corners and the first on its tip in the middle: the best there is for five."""
    page, border, gap = task.options.resolution, task.options.border, task.options.gap
    side = ((page / 2 - border) * np.sqrt(2) - gap) / (np.sqrt(2) + 0.5)
    low = border + side / 2
    at = np.array([[low, low], [low, page - low], [page - low, low], [page - low, page - low]])
    offset = np.r_[[[page / 2, page / 2]], at]
    return Placement(side, np.array([np.pi / 4, 0, 0, 0, 0]), offset, np.zeros(N, np.int64))


def five_squares(shapes: object, options: PackOptions) -> bool:
    return options.rotate == "free"


TOY = Row("quincunx", Packer(quincunx, five_squares), "five squares like the five of a die")


def is_quincunx(packed: Packed) -> bool:
    centre = packed.uv.reshape(N, 4, 2).mean(1)
    return bool(np.abs(centre[1:] - 0.5).min() > 0.25) and np.allclose(centre[0], 0.5)


def use(monkeypatch: pytest.MonkeyPatch, *rows: Row[Packer]) -> None:
    monkeypatch.setattr("circparam.packing.table.PACKERS", Table("packer", *rows))


def test_one_row_adds_a_packer(monkeypatch: pytest.MonkeyPatch) -> None:
    without = pack(*squares(), OPTIONS)
    assert not is_quincunx(without)
    use(monkeypatch, *PACKERS, TOY)
    packed = pack(*squares(), OPTIONS)
    assert is_quincunx(packed)
    assert packed.scale > without.scale
    assert packed.share[0] == pytest.approx(N * packed.scale**2, rel=0.02)


def test_a_packer_runs_where_it_applies_only(monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, TOY)
    assert is_quincunx(pack(*squares(), OPTIONS))
    with pytest.raises(OptionError, match="do not fit"):
        pack(*squares(), PackOptions(resolution=256, rotate="none"))


def test_a_looser_packer_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    without = pack(*squares(), OPTIONS)
    known: list[list[str]] = []

    def loose(task: PackTask) -> Placement:
        known.append(sorted(task.found))
        placement = quincunx(task)
        return Placement(placement.scale / 2, placement.angle, placement.offset, placement.page)

    use(monkeypatch, *PACKERS, Row("loose", Packer(loose), "the same, half as large"))
    np.testing.assert_array_equal(pack(*squares(), OPTIONS).uv, without.uv)
    assert known == [["nest", "shelf"]]  # it may start from what the rows before it found


def test_a_packer_that_overlaps_is_refused_by_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """It claims the largest scale, so it is looked at first; the next one is taken."""
    sound: list[bool] = []

    def bad(task: PackTask) -> Placement:
        placement = quincunx(task)
        too_large = Placement(
            placement.scale * 1.1, placement.angle, placement.offset, placement.page
        )
        sound.extend([task.sound(placement), task.sound(too_large)])
        return too_large

    without = pack(*squares(), OPTIONS)
    use(monkeypatch, *PACKERS, Row("bad", Packer(bad), "charts over each other"))
    np.testing.assert_array_equal(pack(*squares(), OPTIONS).uv, without.uv)
    assert sound == [True, False]


def test_a_fallback_runs_where_only_a_start_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(shapes: object, options: object) -> bool:
        return False

    def fails(task: PackTask) -> Placement | None:
        return None

    shelf = PACKERS["shelf"]
    empty = Row("empty", Packer(fails), "finds nothing")
    fallback = Row("fallback", Packer(quincunx, never, fallback=True), "where nothing else is")
    use(monkeypatch, shelf, empty, Row("other", Packer(quincunx, never), "no fallback"))
    assert not is_quincunx(pack(*squares(), OPTIONS))
    use(monkeypatch, shelf, empty, fallback)
    assert is_quincunx(pack(*squares(), OPTIONS))
    ran: list[str] = []

    def recorded(task: PackTask) -> Placement:
        ran.append("fallback")
        return quincunx(task)

    use(monkeypatch, TOY, Row("fallback", Packer(recorded, never, fallback=True), "not needed"))
    assert is_quincunx(pack(*squares(), OPTIONS))
    assert ran == []


def test_only_instant_packers_run_after_the_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    class Over(Monitor):
        @property
        def expired(self) -> bool:
            return True

    use(monkeypatch, PACKERS["shelf"], TOY)
    assert not is_quincunx(pack(*squares(), OPTIONS, Over()))
    use(monkeypatch, Row("quincunx", Packer(quincunx, instant=True), "takes no time"))
    assert is_quincunx(pack(*squares(), OPTIONS, Over()))


@pytest.mark.parametrize("row", list(PACKERS), ids=PACKERS.names())
def test_every_row_places_charts_by_itself(row: Row[Packer]) -> None:
    """Without any placement to start from, and so that the check finds nothing wrong."""
    shapes, options = shapes_of(*squares(12)), replace(OPTIONS, effort=0.2)

    def sound(placement: Placement) -> bool:
        return finish(shapes, placement, options)[1] is None

    placement = row.function(PackTask(shapes, options, Monitor(), {}, sound))
    assert placement is not None
    packed, wrong = finish(shapes, placement, options)
    assert wrong is None
    assert packed.share[0] > 0.5
    assert row.summary
