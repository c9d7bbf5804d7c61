"""circparam unwraps triangle meshes: few charts, bounded distortion, no flips, nothing of the file lost.

::

    import circparam

    result = circparam.unwrap("mesh.obj", "mesh_uv.obj")
    result.uv, result.uv_faces, result.charts, result.measures

Importing the package is light: NumPy, SciPy and trimesh are loaded when the first function is used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from circparam._version import __version__
from circparam.errors import (
    CircparamError,
    GateError,
    InputError,
    NoResultError,
    OptionError,
    OutOfTimeError,
    OutputError,
    TopologyError,
)

if TYPE_CHECKING:
    from circparam.formats import Document, read, write
    from circparam.inspection import inspect
    from circparam.mesh import Mesh, UVMap
    from circparam.options import Options
    from circparam.output import save
    from circparam.pipeline import repack, unwrap
    from circparam.report.summary import summarise
    from circparam.result import Result

_HOME = {
    "unwrap": "circparam.pipeline",
    "repack": "circparam.pipeline",
    "inspect": "circparam.inspection",
    "Result": "circparam.result",
    "save": "circparam.output",
    "Options": "circparam.options",
    "read": "circparam.formats",
    "write": "circparam.formats",
    "Document": "circparam.formats",
    "summarise": "circparam.report.summary",
    "Mesh": "circparam.mesh",
    "UVMap": "circparam.mesh",
}
_ROOMS = ("samples", "errors", "methods", "seams", "packing", "formats", "pipeline", "report")

__all__ = [
    "CircparamError",
    "Document",
    "GateError",
    "InputError",
    "Mesh",
    "NoResultError",
    "OptionError",
    "Options",
    "OutOfTimeError",
    "OutputError",
    "Result",
    "TopologyError",
    "UVMap",
    "__version__",
    "inspect",
    "read",
    "repack",
    "save",
    "summarise",
    "unwrap",
    "write",
]


def __getattr__(name: str) -> Any:
    """Load a public name, or a room of the package, when it is first asked for."""
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    if name in _ROOMS:
        return importlib.import_module(f"circparam.{name}")
    raise AttributeError(f"module 'circparam' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_ROOMS])
