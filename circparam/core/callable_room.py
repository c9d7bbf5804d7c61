"""Rooms that are functions too: ``circparam.bake`` is a package, and ``circparam.bake(mesh, ...)`` works."""

import importlib
import sys
import types
from collections.abc import Callable
from typing import Any


def make_callable(name: str, function: Callable[[], Callable[..., Any]]) -> None:
    """Let the module ``name`` be called: with the function that ``function`` loads when it is first needed."""

    class Room(types.ModuleType):
        def __call__(self, *args: Any, **keywords: Any) -> Any:
            return function()(*args, **keywords)

        def __reduce__(self) -> tuple[Callable[[str], Any], tuple[str]]:
            return importlib.import_module, (name,)  # so that a pool of processes can call it

    sys.modules[name].__class__ = Room
