"""``circparam methods``: what the table of methods says is what is printed."""

import json

from click.testing import CliRunner, Result

from circparam.cli import cli
from circparam.core.registry import TAGS
from circparam.methods import METHODS


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["methods", *words])


def test_every_method_with_its_guarantees() -> None:
    result = run()
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    for row in METHODS:
        cells = next(line for line in lines if line.startswith(row.name + " ")).split()[1:]
        assert cells == ["yes" if tag in row.tags else "-" for tag in TAGS]


def test_json_has_source_and_condition() -> None:
    rows = {r["name"]: r for r in json.loads(run("--json").stdout)}
    assert list(rows) == METHODS.names()
    for row in METHODS:
        assert rows[row.name]["source"] == row.citation
        assert set(rows[row.name]["guarantees"]) == set(row.tags)


def test_one_method() -> None:
    result = run("circle")
    assert result.exit_code == 0
    assert "Kim 2019" in result.stdout
    title = "Surface Parameterization Based on Circular Centering Property"
    assert title in " ".join(result.stdout.split())
    assert json.loads(run("circle", "--json").stdout)["name"] == "circle"


def test_unknown_method_names_the_nearest() -> None:
    result = run("mean-valu")
    assert result.exit_code == 2
    assert "did you mean mean-value" in result.stderr
