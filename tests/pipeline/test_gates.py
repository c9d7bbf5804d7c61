"""Gates: conditions read from a line, and held against the numbers of a report."""

import pytest

from circparam import samples
from circparam.errors import OptionError
from circparam.pipeline.gates import LAYOUT, RUN, TOPOLOGY, parse_gates
from circparam.pipeline.inspect import inspect
from circparam.pipeline.summary import summarise, summarise_check
from circparam.pipeline.unwrap import unwrap


def test_gates_compare() -> None:
    gates = parse_gates("flips>0, distortion >= 1.05,charts<=3,pack!=1")
    report = {"flips": 0, "distortion": 1.05, "charts": 4, "pack": 1.0}
    assert gates.missed(report) == ["distortion>=1.05: it is 1.05"]
    assert parse_gates(None).missed(report) == []
    assert parse_gates("pack<0.5").missed({"pack": None}) == ["pack<0.5: it was not measured here"]


def test_the_status_is_a_gate_by_its_name_alone() -> None:
    ok, bad = {"status": "ok"}, {"status": "degraded"}
    for text in ("degraded", "status==degraded", "status!=ok", "flips>0, degraded"):
        gates = parse_gates(text)
        assert gates.missed({**ok, "flips": 0}) == []
        assert len(gates.missed({**bad, "flips": 0})) == 1
    assert parse_gates("degraded").missed(bad) == ["status==degraded: it is degraded"]


def test_every_figure_of_the_reports_is_a_gate() -> None:
    mesh = samples.path("knot")
    document = unwrap(mesh, cut="disk", method="lscm", effort=0.01).document
    found = summarise(unwrap(document, cut="disk", method="lscm", effort=0.01))
    judged = summarise_check(inspect(document, weld=0.0))
    for report, names in ((found, (*LAYOUT, *RUN)), (judged, TOPOLOGY)):
        figures = {k for k, v in report.items() if isinstance(v, (int, float))}
        assert figures <= {*names}


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("flip>0", "did you mean flips"),
        ("flips", "NAME>NUMBER"),
        ("", "NAME>NUMBER"),
        ("flips>0,", "NAME>NUMBER"),
        ("flips>many", "not a number"),
        ("flips>nan", "NaN"),
        ("flips=0", "NAME>NUMBER"),
        ("status>ok", "by == or !="),
        ("status==bad", "ok, repaired, degraded"),
        ("degradd", "NAME>NUMBER"),
        ("genus>0", "unknown name"),  # unwrap does not report it
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
