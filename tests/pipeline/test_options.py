"""Options are checked when they are made, and none is ignored in silence."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.pipeline.options import Options, from_keywords

BAD = {
    "unknown cut": ({"cut": "chart"}, "choose one of charts, disk, none"),
    "bound below perfect": ({"max_distortion": 0.9}, "max-distortion"),
    "no number": ({"max_distortion": "1.1"}, "max-distortion"),
    "not a number": ({"max_distortion": float("nan")}, "max-distortion"),
    "a flag for a number": ({"padding": True}, "padding"),
    "negative padding": ({"padding": -1}, "padding"),
    "padding without room": ({"padding": 8, "resolution": 16}, "no room"),
    "no pages": ({"pages": 0}, "pages"),
    "no time": ({"timeout": 0}, "timeout"),
    "negative weld": ({"weld": -0.1}, "weld"),
    "boundary of a free method": ({"method": "isometric", "boundary": "circle"}, "free boundary"),
    "clamp of a free method": ({"method": "lscm", "clamp": True}, "free boundary"),
    "start of a convex method": (
        {"method": "circle", "start": "uniform"},
        "only --method isometric",
    ),
    "pins of a convex method": ({"method": "circle", "pins": np.zeros((2, 3))}, "no single points"),
    "tolerance of one solve": ({"method": "lscm", "tolerance": 1e-3}, "one solve"),
    "bound of a disk": ({"cut": "disk", "max_distortion": 1.1}, "--cut charts"),
    "no stretch at all": ({"max_stretch": 1.0}, "more than 1"),
    "shrink for a stretch": ({"max_stretch": 0.5}, "max-stretch"),
    "stretch of a disk": ({"cut": "disk", "max_stretch": 2.0}, "--cut charts"),
    "stretch of another method": ({"method": "lscm", "max_stretch": 2.0}, "isometric layouts"),
    "stretch of a blend": ({"blend": 0.5, "max_stretch": 2.0}, "without --blend"),
    "stretch with pins": ({"pins": np.zeros((2, 3)), "max_stretch": 2.0}, "--pin"),
    "charts of a disk": ({"cut": "disk", "max_charts": 3}, "--cut charts"),
    "seams where none are": ({"cut": "none", "sharp": 1.0}, "makes no seams"),
    "padding without packing": ({"normalize": False, "padding": 2}, "--no-normalize"),
    "overwrite of no set": ({"overwrite_uv": True}, "--uv-set"),
    "polygon of no boundary": ({"method": "circle", "polygon": np.eye(3, 2)}, "--boundary polygon"),
    "boundary without polygon": ({"method": "circle", "boundary": "polygon"}, "polygon FILE"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_options(name: str) -> None:
    keywords, word = BAD[name]
    with pytest.raises(OptionError, match=word) as error:
        Options(**keywords)
    assert "\n" not in str(error.value)


def test_defaults_and_given() -> None:
    o = Options()
    assert (o.method, o.cut, o.bound) == ("isometric", "charts", 1.05)
    assert o.given() == {}
    o = Options(method="circle", cut="disk", boundary="square")
    assert o.bound is None
    assert o.given() == {
        "method": "circle",
        "cut": "disk",
        "boundary": "square",
        "border": "square",
    }


def test_options_are_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Options().method = "circle"  # type: ignore[misc]


def test_unknown_keyword() -> None:
    with pytest.raises(OptionError, match="did you mean method"):
        from_keywords({"mehtod": "circle"})


def test_older_names_keep_working() -> None:
    old = from_keywords({"method": "circle", "cut": "disk", "border": "square"})
    assert old.given() == Options(method="circle", cut="disk", boundary="square").given()
    assert from_keywords({"method": "bff", "bff_border": "disk"}).bff_boundary == "disk"
