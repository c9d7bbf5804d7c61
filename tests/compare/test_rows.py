"""Rows as plain values: every figure there, none that JSON cannot hold."""

import json
import math

import numpy as np

from circparam.compare.rows import FIGURES, Comparison, Entry
from circparam.mesh.mesh import UVMap


def entry() -> Entry:
    figures = {"charts": 2, "distortion": math.inf, "angle": math.nan, "pack": None, "area": 1.5}
    uvmap = UVMap(np.zeros((3, 2)), np.array([[0, 1, 2]]))
    return Entry("circle", "invalid", {"solve": 0.5}, 0.75, 100, figures, 3, uvmap=uvmap)


def test_a_row() -> None:
    plain = entry().as_dict()
    assert set(FIGURES) <= set(plain)
    assert (plain["charts"], plain["area"], plain["stages"]) == (2, 1.5, {"solve": 0.5})
    assert plain["distortion"] is plain["angle"] is plain["pack"] is plain["flips"] is None
    assert "uvmap" not in plain
    assert "figures" not in plain
    json.dumps(plain, allow_nan=False)


def test_a_comparison() -> None:
    whole = Comparison("m.obj", 4, 2, "disk", 0.25, [entry()], ["a note"]).as_dict()
    assert [row["method"] for row in whole["rows"]] == ["circle"]
    assert (whole["vertices"], whole["faces"], whole["notes"]) == (4, 2, ["a note"])
