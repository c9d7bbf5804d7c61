"""Density by what a face is: asked is got, names that are none are refused, parts never share a chart."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam import samples
from circparam.errors import InputError, OptionError
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.geometry.page_figures import chart_densities
from circparam.pipeline.density import find_density
from circparam.pipeline.named_numbers import named_numbers
from circparam.pipeline.result import Result
from circparam.pipeline.summary import summarise
from circparam.pipeline.unwrap import repack
from tests.support import shapes
from tests.support.command_line import obj, report, run

QUICK: dict[str, Any] = {"effort": "draft", "resolution": 512, "pack_splits": 0, "hide_seams": 0}
BRACKET = samples.path("bracket")


def rows(result: Result) -> dict[str, dict[str, Any]]:
    found = summarise(result)["density"]
    return {row["name"]: row for row in found}


def bars() -> circparam.Document:
    """A long bar of six sides, welded all round."""
    return from_arrays(*shapes.cylinder(6, 12, caps=True, height=6.0))


@pytest.mark.parametrize("asked", ["steel=2", "paint=0.5,steel=3", "plate=2"])
def test_what_is_asked_of_names_is_got(asked: str) -> None:
    result = circparam.unwrap(BRACKET, density=asked, **QUICK)
    assert result.status == "ok"
    for name, number in named_numbers(asked).items():
        assert rows(result)[name]["asked"] == pytest.approx(number)
        assert rows(result)[name]["got"] == pytest.approx(number, rel=0.02)


@pytest.mark.parametrize("ratio", [0.2, 4.0])
def test_a_number_a_face_is_got_and_parts_share_no_chart(ratio: float) -> None:
    document = bars()
    m = len(document.mesh.faces)
    value = np.where(document.mesh.points[document.mesh.faces, 2].mean(1) > 2.0, ratio, 1.0)
    assert 0 < (value == ratio).sum() < m
    result = circparam.unwrap(document, density=value, **QUICK)
    found = result.verification
    assert result.status == "ok"
    source = result.surface.source
    of_chart = [set(value[source[found.cut_mesh.chart == k]]) for k in range(found.charts)]
    assert all(len(kinds) == 1 for kinds in of_chart)
    dense = chart_densities(result.surface, found.cut_mesh, found.uv)
    asked = np.array([next(iter(kinds)) for kinds in of_chart])
    assert dense / asked == pytest.approx(np.full(len(dense), (dense / asked).mean()), rel=0.02)


def test_even_is_what_nobody_asks_for() -> None:
    uv = [circparam.unwrap(bars(), density=d, **QUICK).uv for d in (None, "even")]
    assert np.array_equal(*uv)


def two_panels(tmp_path: Path) -> Path:
    """Two squares with materials face and sole, the second laid out three times as large, as a file."""
    path = tmp_path / "panels.obj"
    path.write_text("""
        v 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\nv .3 0 0\nv .4 0 0\nv .4 .1 0\nv .3 .1 0
        vt 0 0\nvt .2 0\nvt .2 .2\nvt 0 .2\nvt .3 0\nvt .9 0\nvt .9 .6\nvt .3 .6
        usemtl face\nf 1/1 2/2 3/3 4/4\nusemtl sole\nf 5/5 6/6 7/7 8/8
    """)
    return path


def test_pack_sizes_charts_by_density_alone(tmp_path: Path) -> None:
    path = two_panels(tmp_path)
    as_given = repack(path, resolution=256)
    assert as_given.measures["density_max"] == pytest.approx(
        3 * as_given.measures["density_min"], rel=1e-3
    )
    even = repack(path, resolution=256, density="even")
    assert even.measures["density_max"] == pytest.approx(even.measures["density_min"], rel=1e-3)
    asked = rows(repack(path, resolution=256, density="sole=0.5"))
    assert asked["sole"]["got"] == pytest.approx(0.5, rel=1e-3)


def test_charts_that_may_not_be_cut_hold_one_density(tmp_path: Path) -> None:
    path = two_panels(tmp_path)
    document = read(path)
    triangles = np.array([1.0, 1.0, 1.0, 2.0])  # polygons get the larger one of their triangles
    assert rows(repack(path, density=triangles))["2"]["faces"] == 2
    points, faces = shapes.grid(3, 3)
    whole = from_arrays(points, faces, uv=points[:, :2])
    with pytest.raises(OptionError, match="1 chart with parts of several densities"):
        repack(whole, density=np.arange(1.0, 1 + len(faces)))
    with pytest.raises(OptionError, match="1 chart with parts"):
        circparam.unwrap(whole, cut="none", density=np.arange(1.0, 1 + len(faces)))
    assert document.uv_sets == (0,)


def test_colours_are_names(tmp_path: Path) -> None:
    points, faces = shapes.row_of(shapes.grid(3, 3), 2, gap=0.5)
    red = np.arange(len(points)) < len(points) // 2
    path = obj(tmp_path / "painted.obj", (np.c_[points, red[:, None] * [1.0, 0, 0]], faces))
    found = find_density(read(path), "#ff0000=4")
    assert np.array_equal(found.value == 4.0, red[faces].all(1))
    with pytest.raises(OptionError, match="painted #00ff00"):
        find_density(read(path), "#00ff00=4")


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ("stel=2", "did you mean steel"),
        ("steel=0", "above 0"),
        ("steel=-1", "above 0"),
        ("steel=nan", "above 0"),
        ("steel=inf", "above 0"),
        ("steel=much", "above 0"),
        ("steel", "No such file"),
        ("steel=2,=3", "not NAME=X"),
        ("steel=2,steel=3", "twice"),
        ("source", "needs --rebake"),
        ("", "write even"),
        ("#ff0000=2", "no colours"),
        ({}, "is empty"),
        ([1.0, 2.0], "2 numbers for"),
        (object(), "one number a face"),
    ],
)
def test_what_makes_no_sense_is_refused(given: object, why: str) -> None:
    with pytest.raises((OptionError, InputError), match=why):
        circparam.unwrap(BRACKET, density=given, **QUICK)


@pytest.mark.parametrize("bad", [np.nan, 0.0, -1.0, np.inf])
def test_numbers_of_faces_are_above_zero(bad: float) -> None:
    points, faces = shapes.grid(3, 3)
    value = np.ones(len(faces))
    value[3] = bad
    with pytest.raises(InputError, match="face 3"):
        find_density(from_arrays(points, faces), value)


def test_the_command_line_has_a_table_and_a_code(tmp_path: Path) -> None:
    path = two_panels(tmp_path)
    numbers = tmp_path / "numbers.txt"
    numbers.write_text("1\n2  # the sole\n")
    words = ("unwrap", path, "-o", tmp_path / "out.obj", "--resolution", 128)
    told = report(*words, "--density", numbers, "-q")
    assert [row["asked"] for row in told["density"]] == [1.0, 2.0]
    shown = run(*words, "--overwrite", "--density", "sole=2")
    assert "density 2.000, 2.000 asked" in shown.stdout
    refused = run(*words, "--overwrite", "--density", "sole=0")
    assert refused.exit_code == 2
