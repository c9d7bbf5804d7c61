"""What is told of peers: nothing that they did not do, and limits as what they are."""

import pytest

from tests.bench.speed import FREE, LARGE, LIMITS, Peer, Run, ends, rows, verdicts

NAMES = ["xatlas", "uvatlas"]


def run(name: str, faces: int, seconds: float, xatlas: Peer, uvatlas: Peer | None = None) -> Run:
    figures = {"charts": 2, "seam_length": 3.0}
    peers = {"xatlas": xatlas, "uvatlas": uvatlas or Peer(None, "not run")}
    return Run(name, faces, {"charts": seconds, "read": 7.0, "write": 9.0}, figures, peers)


def line(runs: list[Run], start: str) -> tuple[float, bool | None, str]:
    found = next(each for each in verdicts(runs) if each.name.startswith(start))
    return found.value, found.met, found.detail


def test_reading_and_writing_are_no_part_of_a_ratio() -> None:
    assert run("a", 10, 3.0, Peer(2.0, "ended")).ratio("xatlas") == 1.5


def test_a_peer_at_its_limit_counts_with_it_and_one_that_failed_nowhere() -> None:
    limit = LIMITS["uvatlas"]
    runs = [
        run("a", 10, 1.0, Peer(0.5, "ended"), Peer(limit, "limit")),
        run("b", 10, 1.0, Peer(0.25, "ended"), Peer(None, "failed")),
        run("c", LARGE, 1.0, Peer(1.0, "ended")),
    ]
    assert line(runs, f"below {LARGE} faces, time / xatlas")[0] == 3.0
    value, met, detail = line(runs, f"below {LARGE} faces, time / uvatlas")
    assert (value, met) == (pytest.approx(1 / limit), True)
    assert detail == "1 of 2 meshes, 1 of them at the peer's limit"
    cells = {row[0]: row[5:7] for row in rows(runs, NAMES)}
    assert cells == {
        "a": [f"> {limit:.2f}", f"< {1 / limit:.2f}"], "b": ["failed", "–"], "c": ["not run", "–"],
    }  # fmt: skip
    assert [row[2:] for row in ends(runs, NAMES)] == [["3", "0", "0", "0"], ["0", "1", "1", "1"]]


def test_small_meshes_have_a_bound_each_and_large_ones_beside_a_slow_peer() -> None:
    runs = [
        run("a", 10, FREE, Peer(1e-3, "ended")),
        run("b", 10, 1.5, Peer(0.2, "ended")),
        run("c", 10, 4.0, Peer(0.2, "ended")),
        run("d", LARGE, 2.1, Peer(1.9, "ended")),
        run("e", LARGE, 2.1, Peer(2.1, "ended")),
        run("counter", LARGE, 4.5, Peer(1.0, "ended")),
    ]
    names = {each.name: each.met for each in verdicts(runs)}
    assert names.pop(f"below {LARGE} faces, time / xatlas's, median") is False
    assert names.pop(f"below {LARGE} faces, meshes above 15 x xatlas' time and {FREE:g} s") is False
    assert names == {"c: seconds": False, "e: time / xatlas'": True, "counter: seconds": False}
