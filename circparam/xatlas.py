"""All of xatlas-python's surface with layouts of circparam: ``import circparam.xatlas as xatlas``.

::

    atlas = xatlas.Atlas()
    atlas.add_mesh(body_vertices, body_faces)
    atlas.add_mesh(head_vertices, head_faces)
    atlas.generate(pack_options=pack_options)
    vmapping, indices, uvs = atlas[0]

Shapes, types, errors and defaults of attributes are those of xatlas 0.0.11; docs/from-xatlas.md says what its
options become. Programs that cannot be changed get it with ``sys.modules["xatlas"] = circparam.xatlas``. NumPy
and SciPy are loaded when the first function is used.
"""

import importlib
from typing import TYPE_CHECKING, Any

from circparam._version import __version__

if TYPE_CHECKING:
    from circparam.integrations.xatlas.atlas import Atlas, parametrize
    from circparam.integrations.xatlas.export import export
    from circparam.integrations.xatlas.layout import Chart, ChartType
    from circparam.integrations.xatlas.options import ChartOptions, PackOptions

_ROOM = "circparam.integrations.xatlas"
_HOME = {
    "Atlas": "atlas",
    "Chart": "layout",
    "ChartType": "layout",
    "parametrize": "atlas",
    "export": "export",
    "ChartOptions": "options",
    "PackOptions": "options",
}

__all__ = [
    "Atlas",
    "Chart",
    "ChartOptions",
    "ChartType",
    "PackOptions",
    "__version__",
    "export",
    "parametrize",
]


def __getattr__(name: str) -> Any:
    """Load a name when it is first asked for."""
    if name not in _HOME:
        raise AttributeError(f"module 'circparam.xatlas' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{_ROOM}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
