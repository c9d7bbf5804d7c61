"""``circparam samples`` and ``circparam methods``: what the tables hold is what is printed."""

from pathlib import Path

import pytest

from circparam import samples
from circparam.core.registry import TAGS
from circparam.methods import METHODS
from tests.support.command_line import done, one_line_error, report, run


@pytest.mark.parametrize("command", ["samples", "methods"])
def test_the_list_names_all_within_80_columns(command: str) -> None:
    result = done(command)
    names = samples.names() if command == "samples" else METHODS.names()
    lines = result.stdout.splitlines()
    assert {line.split()[0] for line in lines if line} >= set(names)
    assert max(map(len, lines)) <= 80
    assert [row["name"] for row in report(command)] == names


def test_every_method_with_its_guarantees_and_source() -> None:
    lines, rows = run("methods").stdout.splitlines(), {r["name"]: r for r in report("methods")}
    for row in METHODS:
        cells = next(line for line in lines if line.startswith(row.name + " ")).split()[1:]
        assert cells == ["yes" if tag in row.tags else "-" for tag in TAGS]
        assert rows[row.name]["source"] == row.citation
        assert set(rows[row.name]["guarantees"]) == set(row.tags)
    page = " ".join(run("methods", "circle").stdout.split())
    assert "Kim 2019" in page
    assert "Surface Parameterization Based on Circular Centering Property" in page
    assert report("methods", "circle")["name"] == "circle"


def test_a_sample_is_described_and_saved_with_its_files(tmp_path: Path) -> None:
    assert report("samples", "knot")["genus"] == "1"
    assert run("samples", "bracket", "-o", tmp_path).exit_code == 0
    for path in samples.files("bracket"):
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bracket.mtl", "bracket.obj"]
    assert run("samples", "vase", "-o", "-").stdout_bytes == samples.path("vase").read_bytes()
    target = tmp_path / "k.stl"
    target.write_text("mine")
    one_line_error(run("samples", "knot", "-o", target), 2, "--overwrite")
    assert target.read_text() == "mine"
    assert run("samples", "knot", "-o", target, "--overwrite").exit_code == 0
    assert target.read_bytes() == samples.path("knot").read_bytes()


def test_names_are_completed_in_the_shell() -> None:
    words = {"COMP_WORDS": "circparam samples cre", "COMP_CWORD": "2"}
    env = {"_CIRCPARAM_COMPLETE": "bash_complete", **words}
    out = run(env=env, prog_name="circparam").output
    assert "creature" in out
    assert "knot" not in out
