"""Modules that dependencies import without need: they load at their first use."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import LazyLoader, find_spec, module_from_spec
from typing import Any

# for building and testing extensions: a tenth of the imports of an unwrap
UNUSED = ("numpy.f2py", "numpy.testing", "numpy.polynomial")


def put_off() -> None:
    """Let those modules of NumPy load at their first use, where nobody has loaded them yet.

    SciPy takes every public name of NumPy (``from numpy import *``), and NumPy loads these when their names are
    asked for. For processes of our own only: the imports of a caller are the caller's choice.
    """
    for name in UNUSED:
        spec = None if name in sys.modules else find_spec(name)
        if spec is None or spec.loader is None:
            continue
        spec.loader = LazyLoader(spec.loader)
        module = module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        package, _, tail = name.rpartition(".")
        setattr(sys.modules[package], tail, module)


class OnDemand:
    """A module that is imported when the first of its names is asked for.

    Modules that ``put_off`` defers are different: a plain ``import`` already asks for their names.
    """

    def __init__(self, module: str) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        value = getattr(import_module(self._module), name)
        setattr(self, name, value)  # and so not asked for again
        return value
