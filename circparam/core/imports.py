"""Modules that load at their first use, alone or not at all, and modules that are functions too."""

import importlib
import sys
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import LazyLoader, find_spec, module_from_spec
from typing import Any

# modules that an unwrap does not use: a sixth of its imports
UNUSED = (
    *("numpy.f2py", "numpy.testing", "numpy.polynomial", "numpy.ma"),
    *("numpy.ctypeslib", "numpy.rec", "numpy.char"),
)
_own = False  # whether this process is one of ours


def put_off() -> None:
    """Let the UNUSED modules of NumPy load at their first use, unless they are loaded already.

    SciPy takes every public name of NumPy (``from numpy import *``), and NumPy loads these when their names are
    asked for. For processes of our own only: the imports of a caller are the caller's choice.
    """
    global _own
    _own = True
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


@contextmanager
def alone(*packages: str) -> Iterator[None]:
    """Inside, modules of these packages are imported without running the code of the packages themselves.

    packages: in the order in which they contain each other; afterwards they are as before, and load whole when
    somebody imports them. For processes of our own only, as ``put_off``.
    """
    missing = [name for name in packages if _own and name not in sys.modules]
    for name in missing:
        spec = find_spec(name)
        if spec is not None:
            sys.modules[name] = module_from_spec(spec)
    try:
        yield
    finally:
        for name in missing:
            sys.modules.pop(name, None)


@cache
def private(module: str, name: str = "", package: str = "") -> Any:
    """A module that is private to SciPy, or a name in it, without the code of the packages round it.

    package: holds the name where a version of SciPy has no such module; None without one.
    """
    parts = module.split(".")
    with alone(*(".".join(parts[:k]) for k in range(2, len(parts)))):
        try:
            found = importlib.import_module(module)
            return getattr(found, name) if name else found
        except (ImportError, AttributeError):
            pass
    return getattr(importlib.import_module(package), name) if package else None


class OnDemand:
    """A module that is imported when the first of its names is asked for.

    Modules that ``put_off`` defers are different: a plain ``import`` already asks for their names.
    """

    def __init__(self, module: str) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        value = getattr(importlib.import_module(self._module), name)
        setattr(self, name, value)  # and so not asked for again
        return value


def make_callable(name: str, function: Callable[[], Callable[..., Any]]) -> None:
    """Let the module ``name`` be called: with the function that ``function`` loads when it is first needed.

    ``circparam.bake`` is a package, and ``circparam.bake(mesh, ...)`` works.
    """

    class Room(types.ModuleType):
        def __call__(self, *args: Any, **keywords: Any) -> Any:
            return function()(*args, **keywords)

        def __reduce__(self) -> tuple[Callable[[str], Any], tuple[str]]:
            return importlib.import_module, (name,)  # so that a pool of processes can call it

    sys.modules[name].__class__ = Room
