"""The functions of ``import circparam``: those of the pipeline, with their options listed and errors in
Python's words."""

import dataclasses
import inspect as introspection
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from circparam.pipeline import together
from circparam.pipeline import unwrap as unwrapping
from circparam.pipeline.options import Options
from circparam.pipeline.result import Result
from circparam.pipeline.words import python_words

P = ParamSpec("P")
T = TypeVar("T")


def with_options(function: Callable[P, T]) -> Callable[P, T]:
    """A function whose signature, as help() and completion show it, lists every option by name and type."""
    signature = introspection.signature(function)
    own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    more = [
        introspection.Parameter(
            f.name, introspection.Parameter.KEYWORD_ONLY, default=f.default, annotation=f.type
        )
        for f in dataclasses.fields(Options)
        if f.name not in signature.parameters
    ]
    function.__signature__ = signature.replace(parameters=[*own, *more])  # type: ignore[attr-defined]
    return function


def _notebook(result: Result) -> str:
    """A result in a notebook."""
    from circparam.render.show import notebook_picture  # images are imported when one is drawn

    return notebook_picture(result)


unwrap = with_options(python_words(unwrapping.unwrap))
unwrap_together = with_options(python_words(together.unwrap_together))
repack = with_options(python_words(unwrapping.repack))
Result._repr_html_ = _notebook  # type: ignore[attr-defined]  # drawn by a room above its own
