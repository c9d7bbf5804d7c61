"""Names of rows: lists, all, baselines, and what is near an unknown one."""

import pytest

from circparam import errors
from circparam.compare import baselines
from circparam.compare.names import method_names
from circparam.methods import METHODS


def test_names_are_checked() -> None:
    assert method_names("all") == METHODS.names()
    assert method_names(" circle, floater ") == ["circle", "floater"]
    assert method_names(["circle"]) == ["circle"]
    with pytest.raises(errors.OptionError, match="did you mean circle"):
        method_names("circel")
    with pytest.raises(errors.OptionError, match="twice"):
        method_names("circle,all")
    with pytest.raises(errors.OptionError, match="names no method"):
        method_names(" , ")


def test_a_baseline_that_is_not_installed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(baselines.importlib.util, "find_spec", lambda name: None)
    assert method_names("circle") == ["circle"]
    with pytest.raises(errors.OptionError, match="not installed"):
        method_names("circle,xatlas-default")
    with pytest.raises(errors.OptionError, match="did you mean xatlas"):
        method_names("xatlass")
