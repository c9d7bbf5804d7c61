"""``circparam samples``: the list, a copy, and refusals."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from circparam import samples
from circparam.cli import cli


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["samples", *words])


def test_list_names_every_sample_within_80_columns() -> None:
    result = run()
    assert result.exit_code == 0
    for name in samples.names():
        assert name in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 80


def test_json_is_the_manifest() -> None:
    rows = json.loads(run("--json").stdout)
    assert [r["name"] for r in rows] == samples.names()
    assert json.loads(run("knot", "--json").stdout)["genus"] == "1"


def test_save_copies_the_bytes_and_the_material_library(tmp_path: Path) -> None:
    result = run("bracket", "-o", str(tmp_path))
    assert result.exit_code == 0
    for path in samples.files("bracket"):
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bracket.mtl", "bracket.obj"]


def test_never_overwrites_unless_told_to(tmp_path: Path) -> None:
    target = tmp_path / "k.stl"
    target.write_text("mine")
    result = run("knot", "-o", str(target))
    assert result.exit_code == 2
    assert "--overwrite" in result.stderr
    assert target.read_text() == "mine"
    assert run("knot", "-o", str(target), "--overwrite").exit_code == 0
    assert target.read_bytes() == samples.path("knot").read_bytes()


def test_to_stdout() -> None:
    assert run("vase", "-o", "-").stdout_bytes == samples.path("vase").read_bytes()


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (("creatur",), 2, "did you mean creature"),
        (("-o", "x.obj"), 2, "needs the name"),
        (("knot", "-o", "knot.obj"), 2, ".stl"),
        (("knot", "-o", "no/such/folder/knot.stl"), 8, "folder"),
    ],
)
def test_refusals_are_one_line(
    words: tuple[str, ...], code: int, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*words)
    assert result.exit_code == code
    assert text in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_names_are_completed_in_the_shell() -> None:
    words = {"COMP_WORDS": "circparam samples cre", "COMP_CWORD": "2"}
    env = {"_CIRCPARAM_COMPLETE": "bash_complete", **words}
    out = CliRunner().invoke(cli, [], env=env, prog_name="circparam").output
    assert "creature" in out
    assert "knot" not in out
