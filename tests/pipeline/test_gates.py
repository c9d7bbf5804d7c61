"""Gates: conditions read from a line, and held against the numbers of a report."""

from __future__ import annotations

import pytest

from circparam.errors import OptionError
from circparam.pipeline.gates import parse_gates


def test_gates_compare() -> None:
    gates = parse_gates("flips>0, distortion >= 1.05,charts<=3,pack!=1")
    report = {"flips": 0, "distortion": 1.05, "charts": 4, "pack": 1.0}
    assert gates.missed(report) == ["distortion>=1.05: it is 1.05"]
    assert parse_gates(None).missed(report) == []
    assert parse_gates("pack<0.5").missed({"pack": None}) == ["pack<0.5: it was not measured here"]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("flip>0", "did you mean flips"),
        ("flips", "NAME>NUMBER"),
        ("", "NAME>NUMBER"),
        ("flips>0,", "NAME>NUMBER"),
        ("flips>many", "no number"),
        ("flips>nan", "NaN"),
        ("flips=0", "NAME>NUMBER"),
    ],
)
def test_bad_gates(text: str, word: str) -> None:
    with pytest.raises(OptionError, match=word):
        parse_gates(text)


@pytest.mark.parametrize(
    ("sign", "holds"),
    [
        ("<", (1, 0, 0)),
        ("<=", (1, 1, 0)),
        ("==", (0, 1, 0)),
        ("!=", (1, 0, 1)),
        (">=", (0, 1, 1)),
        (">", (0, 0, 1)),
    ],
)
def test_every_sign_below_at_and_above_its_number(sign: str, holds: tuple[int, ...]) -> None:
    gates = parse_gates(f"charts{sign}2")
    assert [len(gates.missed({"charts": n})) for n in (1, 2, 3)] == list(holds)
    assert str(gates.gates[0]) == f"charts{sign}2"
