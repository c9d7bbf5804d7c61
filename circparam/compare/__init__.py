"""Methods side by side, each in a process of its own; xatlas as a baseline; Table 1 of the source.

The package can be called: ``circparam.compare(mesh, methods)`` is ``circparam.compare.compare.compare``.
"""

from collections.abc import Callable
from typing import Any

from circparam.core.imports import make_callable


def _function() -> Callable[..., Any]:
    from circparam.compare.compare import compare
    from circparam.pipeline.words import python_words

    return python_words(compare)


make_callable(__name__, _function)
