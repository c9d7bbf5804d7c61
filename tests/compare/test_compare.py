"""Methods side by side: the same cut for all, rows that can be trusted, failures that are rows."""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam import errors, samples
from circparam.compare.baselines import BASELINES, task
from circparam.compare.compare import compare, method_names
from circparam.compare.rows import COMPARED_FIGURES, INPUT_ROW, Comparison, Entry
from circparam.core import own_process
from circparam.methods import METHODS
from tests.support import shapes
from tests.support.command_line import obj


@pytest.fixture(scope="module")
def disk() -> Comparison:
    return compare(shapes.bumped_disk(300), "circle,mean-value,floater,lscm")


def quick(source: object, methods: str, **keywords: object) -> Comparison:
    """In this process: the same rows without a peak memory."""
    return compare(source, methods, isolate=False, **keywords)


def row(c: Comparison, name: str) -> dict[str, Any]:
    return next(r for r in c.rows if r.method == name).as_dict()


def test_every_method_gets_the_identical_cut(disk: Comparison) -> None:
    assert disk.cut == "disk"  # which makes no seam where there is a disk already
    assert [r.method for r in disk.rows] == ["circle", "mean-value", "floater", "lscm"]
    assert {r.figures["charts"] for r in disk.rows} == {1}
    assert {r.figures["seam_length"] for r in disk.rows} == {0.0}


def test_stages_and_memory_are_measured(disk: Comparison) -> None:
    for r in disk.rows:
        # a stage is a part of its run, and so is its median of the median; the sum of medians need not be
        assert all(0 < s <= r.seconds for s in r.stages.values())
        assert r.peak_bytes >= 0
    assert {"weights", "solve"} <= set(disk.rows[0].stages)


def test_figures_agree_with_an_unwrap(disk: Comparison) -> None:
    from circparam.pipeline.unwrap import unwrap

    result = unwrap(shapes.bumped_disk(300), cut="none", method="mean-value")
    mine = row(disk, "mean-value")
    for name in ("distortion", "stretch_l2", "angle", "area"):
        assert mine[name] == pytest.approx(result.measures[name], rel=1e-5)


def test_a_mesh_with_holes_stays_whole_and_a_closed_one_is_cut_as_asked() -> None:
    for shape in (shapes.holed_sheet(4), shapes.cylinder(12, 4)):
        c = quick(shape, "circle")
        assert (c.cut, row(c, "circle")["seam_length"]) == ("disk", 0)
    c = quick(shapes.icosphere(2), "mean-value", cut="disk")
    assert (c.cut, row(c, "mean-value")["charts"], row(c, "mean-value")["flips"]) == ("disk", 1, 0)


def test_the_uv_of_the_file_is_the_first_row() -> None:
    c = quick(samples.path("vase"), "circle", cut="disk")
    assert [r.method for r in c.rows] == [INPUT_ROW, "circle"]
    own = c.rows[0]
    assert own.seconds is None
    assert own.figures["charts"] == 2
    assert own.figures["flips"] == 0
    assert own.figures["overlap"] != 0  # both parts fill the whole texture
    assert own.status == "invalid"


def test_input_row_of_a_layout_that_is_perfect(tmp_path: Path) -> None:
    p, f = shapes.delaunay_square(50)
    c = quick(obj(tmp_path / "flat.obj", (p, f), p[:, :2]), "uniform")
    own = row(c, INPUT_ROW)
    assert own["status"] == "ok"
    assert own["distortion"] == pytest.approx(1, abs=1e-9)
    assert own["seam_length"] == 0
    assert row(c, "uniform")["distortion"] > 1.001


@pytest.mark.parametrize("name", BASELINES)
def test_a_baseline_is_a_row_with_seams_of_its_own(name: str) -> None:
    pytest.importorskip(BASELINES[name])
    c = quick(shapes.cube(4), f"isometric,{name}")
    own = row(c, name)
    assert own["charts"] == 6 > row(c, "isometric")["charts"]
    assert own["mirrored"] == 0 or name == "xatlas-default"
    assert own["distortion"] == pytest.approx(1, abs=1e-4)
    assert own["seconds"] > 0
    with pytest.raises(errors.OptionError, match="no effect"):
        quick(shapes.cube(1), name, boundary="square")


@pytest.mark.parametrize("name", BASELINES)
def test_the_page_of_a_baseline_is_undone(name: str) -> None:
    """A flat strip comes back as a strip: angles and the ratio of its sides are kept."""
    pytest.importorskip(BASELINES[name])
    points, faces = shapes.grid(9, 3)
    points = points * [4, 1, 1]
    made, info = task({"points": points, "faces": faces}, {"method": name})
    assert info["stages"]["atlas"] > 0
    assert 0 <= made["uv"].min() < made["uv"].max() <= 1
    flat, before = made["uv"][made["uv_faces"]], points[faces]
    ratio = np.linalg.norm(flat - flat[:, [1, 2, 0]], axis=2)
    ratio /= np.linalg.norm(before - before[:, [1, 2, 0]], axis=2)
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=1e-3)


def test_names_are_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    assert method_names("all") == METHODS.names()
    assert method_names(" circle, floater ") == ["circle", "floater"]
    assert method_names(["circle"]) == ["circle"]
    for package in ("uvunwrap", "xatlas"):
        monkeypatch.setitem(sys.modules, package, None)
    for words, said in (
        ("circel", "did you mean circle"),
        ("circle,all", "twice"),
        (" , ", "names no method"),
        ("circle,uvunwrap", "uvunwrap is not installed: pip"),
        ("circle,xatlas-default", "xatlas is not installed: pip"),
        ("xatlass", "did you mean xatlas"),
    ):
        with pytest.raises(errors.OptionError, match=said):
            method_names(words)


def test_a_method_that_fails_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> own_process.Outcome:
        return own_process.Outcome(error="no such luck")

    monkeypatch.setattr(own_process, "here", broken)
    c = quick(shapes.bumped_disk(100), "circle")
    assert (c.rows[0].status, c.rows[0].error) == ("failed", "no such luck")
    assert c.rows[0].as_dict()["distortion"] is None


def test_a_layout_with_flips_is_invalid(monkeypatch: pytest.MonkeyPatch) -> None:
    real = own_process.here

    def folded(*given: Any) -> own_process.Outcome:
        done = real(*given)
        done.arrays["uv"][:, 0] = np.abs(done.arrays["uv"][:, 0])
        return done

    monkeypatch.setattr(own_process, "here", folded)
    c = quick(shapes.bumped_disk(100), "mean-value")
    assert c.rows[0].status == "invalid"
    assert row(c, "mean-value")["flips"] > 0


def test_options_go_where_they_apply() -> None:
    square = quick(shapes.bumped_disk(100), "circle,lscm", boundary="square")
    round_ = quick(shapes.bumped_disk(100), "circle,lscm")
    assert row(square, "circle")["distortion"] != row(round_, "circle")["distortion"]
    assert row(square, "lscm")["distortion"] == row(round_, "lscm")["distortion"]
    for methods, keywords in (
        ("lscm", {"boundary": "square"}),
        ("circle,lscm", {"blend": 0.5}),
        ("circle", {"tolerance": 0.5}),
    ):
        with pytest.raises(errors.OptionError, match="no effect"):
            quick(shapes.bumped_disk(100), methods, **keywords)


def test_bad_requests() -> None:
    with pytest.raises(errors.OptionError, match="cut"):
        quick(shapes.triangle(), "circle", cut="chart")
    with pytest.raises(errors.TopologyError):
        quick(shapes.icosphere(1), "circle", cut="none")
    with pytest.raises(errors.InputError):
        quick("nowhere.obj", "circle")


def test_rows_are_plain_values(disk: Comparison) -> None:
    """Every figure is there, and none that JSON cannot hold."""
    figures = {"charts": 2, "distortion": math.inf, "angle": math.nan, "pack": None, "area": 1.5}
    row = Entry("x", "ok", figures=figures, uvmap=disk.rows[0].uvmap)
    whole = replace(disk, rows=[*disk.rows, row]).as_dict()
    json.dumps(whole, allow_nan=False)
    assert whole["cut_seconds"] >= 0
    for entry in whole["rows"]:
        assert set(COMPARED_FIGURES) <= set(entry)
        assert not {"uvmap", "figures"} & set(entry)
    plain = whole["rows"][-1]
    assert (plain["charts"], plain["area"]) == (2, 1.5)
    assert plain["distortion"] is plain["angle"] is plain["pack"] is plain["flips"] is None
