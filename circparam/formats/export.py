"""Write a mesh with uv into a format that is not its own: OBJ, PLY or GLB from anything."""

from __future__ import annotations

from circparam.errors import OptionError
from circparam.formats.document import Document, WriteOptions


def lost(document: Document, *kept: str) -> list[str]:
    """A note on what of the input the new format does not carry."""
    gone = [f for f in document.features if f not in kept]
    return [f"not carried into the new format: {', '.join(gone)}"] if gone else []


def only_first_set(options: WriteOptions, format: str) -> None:
    """Raise OptionError for a uv set that a new file does not have."""
    if options.uv_set:
        raise OptionError(
            f"uv set {options.uv_set}: a new {format.upper()} file gets one uv set; leave it out"
        )
