"""The report as plain values: what JSON holds, and what it says."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.formats.memory import from_arrays
from circparam.pipeline.summary import json_value
from tests.support import shapes

FLAT = {"cut": "none", "method": "mean-value", "effort": 0.01}


def test_an_unwrap_and_a_repack_say_what_they_are_in_json(tmp_path: Path) -> None:
    path = tmp_path / "o.obj"
    p, f = shapes.bumped_disk(40)
    result = circparam.unwrap((p, f), path, boundary="square", **FLAT)
    report = json.loads(json.dumps(circparam.summarise(result), allow_nan=False))
    assert (report["schema"], report["output"]) == ("circparam/unwrap/1", str(path))
    assert (report["method"], report["cut"]) == ("mean-value", "none")
    assert report["options"]["boundary"] == report["options"]["border"] == "square"
    assert (report["vertices"], report["faces"]) == (len(p), len(f))
    assert report["seconds"] == pytest.approx(sum(report["stages"].values()), abs=0.01)
    again = circparam.summarise(circparam.repack(path, effort=0.01))
    assert again["schema"] == "circparam/pack/1"
    assert again["method"] == again["cut"] == "as given"


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_what_json_cannot_hold_is_null(value: float) -> None:
    assert json_value(value) is None
    assert (json_value(1.5), json_value(0), json_value("x")) == (1.5, 0, "x")


def test_a_half_empty_page_gets_advice_that_keeps_its_word() -> None:
    """Cuts across a long roll: what the advice tells is what the option gives."""
    points, faces = shapes.grid(131, 3, 60.0, 1.0)
    roll = np.stack([np.cos(points[:, 0]), np.sin(points[:, 0]), points[:, 1]], 1)
    roll *= 1 + points[:, :1] / 60  # a spiral: no turn lies on another
    page = {"effort": 1, "jobs": 1, "resolution": 512}
    report = circparam.summarise(circparam.unwrap((roll, faces), **page))
    (line,) = report["warnings"]
    found = re.fullmatch(
        r"(\d+) % of the page is covered: (\d+) cuts? across charts would cover (\d+) % \((.*)\)",
        line,
    )
    assert found is not None, line
    before, cuts, told = (int(found[k]) for k in (1, 2, 3))
    assert found[4] == "--pack-splits 10"
    assert before == round(100 * report["pack"])
    again = circparam.unwrap((roll, faces), pack_splits=10, **page)
    assert again.measures["charts"] == report["charts"] + cuts
    assert 100 * float(again.measures["pack"] or 0) == pytest.approx(told, abs=1)
    assert not circparam.summarise(again)["warnings"]


def test_no_advice_is_given_that_was_not_tried(tmp_path: Path) -> None:
    """A strip fills little of a square: where no cut may be made, no option is guessed at."""
    strip = shapes.grid(40, 3, 20.0, 1.0)
    path = tmp_path / "o.obj"
    result = circparam.unwrap(strip, path, cut="none", effort=0.01)
    assert circparam.summarise(result)["pack"] < 0.5
    assert not circparam.summarise(result)["warnings"]
    assert not circparam.summarise(circparam.repack(path, effort=0.01, rotate="none"))["warnings"]


def test_gaps_that_take_up_the_page_want_more_texels() -> None:
    """100 squares with 15 texels between them on a page of 256: each has more round it than it covers."""
    points, faces = shapes.grid(2, 2)
    many = np.concatenate([points + np.array([3.0 * k, 0, 0]) for k in range(100)])
    squares = np.concatenate([faces + len(points) * k for k in range(100)])

    def warned(**options: int) -> list[str]:
        result = circparam.unwrap(
            (many, squares), cut="none", effort=0.01, resolution=256, **options
        )
        return [line for line in circparam.summarise(result)["warnings"] if "covered" in line]

    (line,) = warned(padding=14)
    gaps = int(line.split("gaps take up to ")[1].split(" %")[0])
    # side s and gap g of 100 squares that just fit: s + g = 25.6, or a little less
    side, gap = 25.6 - 15, 15
    most = 100 * (4 * side * gap / 2 + np.pi * gap**2 / 4) / 256**2
    assert gaps == pytest.approx(100 * most, abs=10)
    assert "--resolution" in line
    assert "--padding" in line
    assert not warned(padding=1)


def test_single_faces_are_not_asked_to_be_cut() -> None:
    """A triangle fills half of a page at most, whatever is asked for."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 0, 0], [6, 0, 0], [5, 1, 0]], float)
    for faces in ([[0, 1, 2]], [[0, 1, 2], [3, 4, 5]]):
        report = circparam.summarise(
            circparam.unwrap((points, np.array(faces)), effort=0.1, padding=400)
        )
        assert report["pack"] < 0.5
        assert not any("covered" in line for line in report["warnings"])


def test_stray_faces_of_a_material_are_told_with_the_cure() -> None:
    """Hundreds of charts of a face each came without a word."""
    points, faces = shapes.icosphere(1)
    material = np.zeros(len(faces), np.int64)
    material[::5] = 1

    def warnings(**options: object) -> list[str]:
        result = circparam.unwrap(
            from_arrays(points, faces, groups=material), effort="draft", jobs=1, **options
        )
        return [w for w in circparam.summarise(result)["warnings"] if "another material" in w]

    assert "--no-cut-materials lets charts cross materials" in warnings()[0]
    assert warnings(cut_materials=False) == warnings(cut_materials=True) == []
    material[:] = points[faces].mean(1)[:, 2] > 0
    assert warnings() == []
