"""A method is one row: added from here it is a choice, is listed, suggested, compared, run and tested."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from circparam.cli import cli
from circparam.core.monitor import Monitor
from circparam.core.registry import Row
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods import METHODS
from circparam.methods.base import Layout, MethodOptions
from tests.contracts import test_methods as contract
from tests.support import shapes
from tests.support.command_line import CONVEX, obj, report, run
from tests.support.toys import added

TAGS = frozenset({"flip-free", "convex-boundary"})


def toy(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor) -> Layout:
    """Mean value coordinates under another name."""
    taken = MethodOptions(boundary=options.boundary, polygon=options.polygon)
    return METHODS["mean-value"].function(cut_mesh, taken, monitor)


def mirrored(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor) -> Layout:
    """What no method may do: every chart lies on its face."""
    right = toy(cut_mesh, options, monitor)
    return Layout(right.uv * [-1, 1], right.iterations, right.stopped, right.notes)


def row(function: Callable[..., Layout] = toy) -> Row[Any]:
    accepts = frozenset({"boundary", "polygon"})
    return Row("toyish", function, "a toy of the tests", "Nobody 2026", TAGS, accepts=accepts)


@pytest.fixture
def toyish() -> Iterator[Row[Any]]:
    with added(METHODS, row()) as new:
        yield new
    assert "toyish" not in METHODS


TOYISH = (*CONVEX[:2], "--method", "toyish", "--effort", "0.01")


@pytest.fixture
def disk(tmp_path: Path) -> Path:
    return obj(tmp_path / "disk.obj", shapes.bumped_disk(80))


def test_it_unwraps_and_is_listed_with_its_guarantees(disk: Path, toyish: Row[Any]) -> None:
    told = report("unwrap", disk, *TOYISH)
    assert (told["method"], told["status"], told["flips"]) == ("toyish", "ok", 0)
    listed = {r["name"]: r for r in json.loads(run("methods", "--json").stdout)}
    assert set(listed["toyish"]["guarantees"]) == TAGS
    assert "a toy of the tests" in run("methods").stdout
    assert "Nobody 2026" in run("methods", "toyish").stdout


def test_it_is_suggested_and_completed_in_the_shell(disk: Path, toyish: Row[Any]) -> None:
    words = (["unwrap", disk, "--method"], ["methods"], ["compare", disk, "--methods"])
    for result in (run(*some, "toyis") for some in words):
        assert result.exit_code == 2
        assert "did you mean toyish" in result.stderr
    typed = {"COMP_WORDS": "circparam unwrap --method toy", "COMP_CWORD": "3"}
    env = {"_CIRCPARAM_COMPLETE": "bash_complete", **typed}
    assert "toyish" in CliRunner().invoke(cli, [], env=env, prog_name="circparam").output


@pytest.mark.parametrize("promise", contract.PROMISES)
def test_it_keeps_the_contract(promise: str, toyish: Row[Any]) -> None:
    contract.PROMISES[promise]("toyish")


@pytest.mark.parametrize("promise", ["fits_the_patches_and_is_upright", "maps_one_triangle"])
def test_the_contract_notices_a_method_that_breaks_it(promise: str) -> None:
    with added(METHODS, row(mirrored)), pytest.raises(AssertionError):
        contract.PROMISES[promise]("toyish")


def test_the_file_is_verified_whatever_a_row_does(disk: Path) -> None:
    with added(METHODS, row(mirrored)):
        told = report("unwrap", disk, *TOYISH)
    assert (told["status"], told["mirrored"]) == ("degraded", 1)
    assert "mirrored" in " ".join(told["reasons"])
