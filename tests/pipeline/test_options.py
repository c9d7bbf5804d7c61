"""Options are checked when they are made, and none is ignored in silence."""

from typing import Any

import numpy as np
import pytest

from circparam.core import limits
from circparam.core.fields import flag, specs
from circparam.errors import OptionError
from circparam.methods import METHODS
from circparam.packing.options import PackOptions
from circparam.pipeline.configure import pack_options
from circparam.pipeline.options import Options, from_keywords
from tests.support.processes import printed

BAD = {
    "unknown cut": ({"cut": "chart"}, "choose one of charts, disk, none"),
    "bound below perfect": ({"max_distortion": 0.9}, "max-distortion"),
    "no number": ({"max_distortion": "1.1"}, "max-distortion"),
    "not a number": ({"max_distortion": float("nan")}, "max-distortion"),
    "a flag for a number": ({"padding": True}, "padding"),
    "negative padding": ({"padding": -1}, "padding"),
    "padding without room": ({"padding": 8, "resolution": 16}, "no room"),
    "no pages": ({"pages": 0}, "pages"),
    "a page too large for packing": ({"resolution": 16385}, "--resolution 16385: .* 1 to 16384"),
    "more pages than packing has": ({"pages": 101}, "--pages 101: .* 1 to 100"),
    "no texel between the paddings": ({"padding": 32, "resolution": 64}, "--padding 31 or less"),
    "a density of sizes that are kept": ({"texel_density": 2.0, "scale": False}, "--no-scale"),
    "unknown method": ({"method": "circel"}, "did you mean circle"),
    "unknown start": ({"start": "lscm"}, "unknown start"),
    "unknown boundary": ({"method": "circle", "boundary": "squar"}, "did you mean square"),
    "unknown spacing": ({"method": "circle", "spacing": "even"}, "arc-length, uniform"),
    "tolerance of abf, which has its own": ({"method": "abf", "tolerance": 1e-3}, "of its own"),
    "cuts of charts that may not be turned": ({"pack_splits": 1, "rotate": "none"}, "fills pages"),
    "group without seams": ({"cut": "none", "group_by": "mesh"}, "needs seams"),
    "lightmap of several atlases": ({"lightmap": True, "group_by": "mesh"}, "one packed atlas"),
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
    "no stretch at all": ({"max_stretch": 1.0}, "above 1"),
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
    "page of no method that fills it": ({"pack_splits": 1, "method": "circle"}, "fills pages"),
    "cuts of a disk for the page": ({"pack_splits": 1, "cut": "disk"}, "fills pages"),
    "cuts of charts that turn by quarters": ({"pack_splits": 1, "rotate": "90"}, "fills pages"),
    "cuts of charts that are not packed": ({"pack_splits": 1, "normalize": False}, "fills pages"),
    "cuts for pages of fixed turns": ({"pages": 4, "pack_splits": 3, "rotate": "none"}, "be cut"),
    "cuts of no kind": ({"pack_splits": "some"}, "give auto or a number"),
    "fewer cuts than none": ({"pack_splits": -1}, "0 to 1000"),
    "padding of no kind": ({"padding": "wide"}, "give auto or a number"),
    "no texels": ({"align_texels": 0}, "1 to 16"),
    "blocks that a page is no multiple of": (
        {"align_texels": 4, "resolution": 1001},
        "multiple of 4",
    ),
    "blocks of borders at any angle": ({"align_texels": 1, "straighten": "off"}, "any angle"),
    "blocks without packing": ({"align_texels": 1, "normalize": False}, "solver"),
    "blocks of sizes that are kept": ({"align_texels": 1, "scale": False}, "--no-scale"),
    "blocks on a page in use": ({"align_texels": 1, "only": "material=a"}, "page that is in use"),
    "straight at fixed angles": ({"straighten": "all", "rotate": "90"}, "--rotate 90"),
    "unknown straightening": ({"straighten": "most"}, "choose one of"),
    "floaters without packing": ({"drop_floaters": 0.1, "normalize": False}, "--no-normalize"),
    "an offset without a stack": ({"stack_offset": True}, "--stack identical"),
    "a stack without packing": ({"stack": "identical", "normalize": False}, "--no-normalize"),
    "a stack of seams of every part": ({"stack": "identical", "keep_uv_seams": True}, "keep"),
    "pages of groups and a number": (
        {"pages_by": "material", "pages": 2},
        "as many pages as groups",
    ),
    "pages and boxes": ({"pages_by": "material", "group_by": "group"}, "already where charts lie"),
    "pages of an unknown kind": ({"pages_by": "colour"}, "choose one of"),
    "pages without packing": ({"pages_by": "material", "normalize": False}, "of the solver"),
    "up and free turns": ({"orient": "up", "rotate": "free"}, "by any angle"),
    "up and straight borders": ({"orient": "up", "straighten": "all"}, "by their borders"),
    "no direction": ({"orient": "down"}, "choose one of"),
    "only on several pages": ({"only": [0], "pages": 2}, "the pages are those in use"),
    "only of stacks": ({"only": [0], "stack": "identical"}, "stack lays out"),
    "only of a lightmap": ({"only": [0], "lightmap": True}, "one atlas"),
    "only without packing": ({"only": [0], "normalize": False}, "--no-normalize"),
    "only of other densities": ({"only": [0], "density": "a=2"}, "sizes all charts anew"),
    "only without floaters": ({"only": [0], "drop_floaters": 0.1}, "whole mesh anew"),
    "only upright": ({"only": [0], "orient": "up"}, "turns all charts anew"),
    "only in pages of their own": ({"only": [0], "pages_by": "node"}, "--pages-by sorts"),
    "a page kept by nothing": ({"keep_page": True}, "it needs --only"),
    "a lock outside pack": ({"lock": [0]}, "circparam pack"),
    "checkpoint of a disk": ({"cut": "disk", "checkpoint": "c"}, "--cut charts"),
    "copies of a reader that copies": ({"unshare": True, "reader": "trimesh"}, "anyway"),
    "boundary without polygon": ({"method": "circle", "boundary": "polygon"}, "polygon FILE"),
}


PINNED = {"method": "lscm", "cut": "disk", "pins": np.zeros((2, 3))}
for _name, _value in (
    *(("resolution", 512), ("padding", 2), ("pages", 2), ("texel_density", 9.0)),
    *(("rotate", "none"), ("effort", 2.0), ("lightmap", True), ("group_by", "mesh")),
):
    BAD[f"{_name} beside pins"] = ({**PINNED, _name: _value}, "has no effect here")


@pytest.mark.parametrize("name", BAD)
def test_bad_options(name: str) -> None:
    keywords, word = BAD[name]
    with pytest.raises(OptionError, match=word) as error:
        Options(**keywords)
    assert "\n" not in str(error.value)


RANGES = {name: spec.bounds for name, spec in specs(Options).items() if spec.bounds is not None}
BESIDE: dict[str, dict[str, Any]] = {  # what an option needs beside it
    "tolerance": {"method": "arap"},
    "padding": {"resolution": limits.RESOLUTION.high},
    "resolution": {"padding": 0},
}


@pytest.mark.parametrize("name", RANGES)
def test_both_ends_of_a_range_belong_to_it_and_nothing_beyond(name: str) -> None:
    low, high = RANGES[name].low, RANGES[name].high
    beside = BESIDE.get(name, {})
    for value in (low, high):
        assert getattr(Options(**beside, **{name: value}), name) == value
    whole = isinstance(low, int)
    for value in (
        low - 1 if whole else low - max(abs(low), 1) * 1e-3,
        high + 1 if whole else high * 1.001,
    ):
        if value in (0.0, high):  # a lowest value of nearly nothing
            continue
        with pytest.raises(OptionError, match=flag(name, specs(Options)[name])):
            Options(**beside, **{name: value})


@pytest.mark.parametrize("name", ["resolution", "padding", "pages", "texel_density"])
def test_what_options_let_pass_packing_takes(name: str) -> None:
    """The ranges stand once: nothing is refused after the solve that could have been before."""
    for value in (RANGES[name].low, RANGES[name].high):
        pack_options(Options(**BESIDE.get(name, {}), **{name: value}))
    beyond = RANGES[name].high * 2
    with pytest.raises(OptionError):
        PackOptions(**{name: beyond})


def test_what_a_method_accepts_is_an_option_with_a_reason() -> None:
    """Whatever a row may accept can be given, and is refused, with a reason, where a row does not."""
    names = {name for row in METHODS for name in row.accepts}
    assert names <= set(specs(Options))
    for name in names - {"polygon"}:
        other = next(row for row in METHODS if name not in row.accepts)
        value = {"start": "uniform", "boundary": "square", "spacing": "uniform", "lscm": "pinned"}
        value |= {"clamp": True, "linear": True}
        with pytest.raises(OptionError, match=r"has no effect here: .*; leave it out"):
            Options(method=other.name, **{name: value.get(name, 0.5)})


def test_importing_the_options_is_light() -> None:
    """The command line reads them for its help."""
    code = "import sys, circparam.pipeline.options; print('numpy' in sys.modules)"
    assert printed(code) == "False\n"


def test_arrays_are_reported_by_shape_and_digest() -> None:
    """A report left them out, as if they had not been given."""
    pairs = [[0, 1], [1, 2]]
    first = Options(seams=pairs).given()["seams"]
    assert first["shape"] == [2, 2]
    assert Options(seams=np.array(pairs)).given()["seams"] == first
    assert Options(seams=pairs[::-1]).given()["seams"]["sha256"] != first["sha256"]


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


def test_none_means_not_given_for_every_option() -> None:
    """A wrapper hands its own None on; ``repair=None`` refused every repair."""
    defaults = Options()
    nothing = Options(**dict.fromkeys(specs(Options)))
    assert all(getattr(nothing, name) == getattr(defaults, name) for name in specs(Options))


@pytest.mark.parametrize("name", ["resolution", "pages", "padding", "max_charts", "jobs"])
def test_counts_are_whole(name: str) -> None:
    """Numbers from JSON or NumPy may be floats; a fraction is no count."""
    assert repr(getattr(Options(**{name: 32.0}), name)) == "32"
    with pytest.raises(OptionError, match="whole number"):
        Options(**{name: 32.5})


def test_older_names_keep_working() -> None:
    old = from_keywords({"method": "circle", "cut": "disk", "border": "square"})
    assert old.given() == Options(method="circle", cut="disk", boundary="square").given()
    assert from_keywords({"method": "bff", "bff_border": "disk"}).bff_boundary == "disk"
