"""circparam unwraps triangle meshes: few charts, bounded distortion, no flips, lossless files.

::

    import circparam

    result = circparam.unwrap("mesh.obj", "mesh_uv.obj")
    result.uv, result.uv_faces, result.charts, result.measures

Importing the package is light: NumPy, SciPy and trimesh are loaded when the first function is used.
"""

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
    from circparam.bake.rebake import rebake
    from circparam.bake.together import rebake_together
    from circparam.formats.document import Document
    from circparam.formats.io import read, write
    from circparam.integrations.parametrize import parametrize
    from circparam.integrations.python import repack, unwrap, unwrap_together
    from circparam.maps import load_map, save_map
    from circparam.maps.lods import transfer
    from circparam.maps.map_surfaces import map_surfaces
    from circparam.mesh.mesh import Mesh, UVMap
    from circparam.pipeline.inspect import inspect
    from circparam.pipeline.options import Options
    from circparam.pipeline.result import Result
    from circparam.pipeline.save import save
    from circparam.pipeline.summary import summarise
    from circparam.render.show import view


# module → its public names
_NAMES = {
    "bake.rebake": "rebake",
    "bake.together": "rebake_together",
    "formats.document": "Document",
    "formats.io": "read write",
    "integrations.parametrize": "parametrize",
    "integrations.python": "repack unwrap unwrap_together",
    "maps": "load_map save_map",
    "maps.lods": "transfer",
    "maps.map_surfaces": "map_surfaces",
    "mesh.mesh": "Mesh UVMap",
    "pipeline.inspect": "inspect",
    "pipeline.options": "Options",
    "pipeline.result": "Result",
    "pipeline.save": "save",
    "pipeline.summary": "summarise",
    "render.show": "view",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}
_ROOMS = (
    *("samples", "errors", "methods", "seams", "packing", "formats", "pipeline"),
    *("xatlas", "bake", "compare"),
)

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
    "load_map",
    "map_surfaces",
    "parametrize",
    "read",
    "rebake",
    "rebake_together",
    "repack",
    "save",
    "save_map",
    "summarise",
    "transfer",
    "unwrap",
    "unwrap_together",
    "view",
    "write",
]


def __getattr__(name: str) -> Any:
    """Load a public name, or a room of the package, when it is first asked for.

    Errors of functions name keywords instead of flags.
    """
    if name in _HOME:
        value = getattr(importlib.import_module(f"circparam.{_HOME[name]}"), name)
        if isinstance(value, type(__getattr__)):
            from circparam.pipeline.words import python_words

            value = python_words(value)
        globals()[name] = value
        return value
    if name in _ROOMS:
        return importlib.import_module(f"circparam.{name}")
    raise AttributeError(f"module 'circparam' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_ROOMS])
