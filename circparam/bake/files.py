"""``circparam.bake``: ``circparam bake`` for files and documents in Python."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from circparam.bake.bake import Across, Baked, bake_document
from circparam.bake.left_behind import check_left_behind
from circparam.bake.write import check_target, write_baked
from circparam.errors import OptionError
from circparam.formats.document import Document
from circparam.formats.io import read


def bake_mesh(
    mesh: str | os.PathLike[str] | Document,
    kind: str,
    output: str | os.PathLike[str] | None = None,
    *,
    source: str | os.PathLike[str] | Document | None = None,
    overwrite: bool = False,
    across: Across | None = None,
    **keywords: Any,
) -> Baked:
    """Carry colours, a texture, normals or heights into the uv of a mesh.

    mesh: a file or a ``Document`` with uv. kind: texture, vertex-colors, normals or height. output: an image
    (.png) or the mesh with the image inside (.glb); None writes nothing. source: the mesh with the colours or
    the shape, None for the mesh itself. across: how places are found on the source. keywords: uv_set, size in
    texels, monitor, see ``bake_document``.

    Returns the images by tile and the notes on them. Raises OptionError, InputError, OutputError.
    """
    target = None if output is None else Path(output)
    if target is not None:
        check_target(target, kind)
        if target.exists() and not overwrite:
            raise OptionError(f"{target}: the file exists; replace it with --overwrite")
    document = mesh if isinstance(mesh, Document) else read(mesh)
    other = source if source is None or isinstance(source, Document) else read(source)
    number = keywords.get("uv_set", 0)
    left = [] if target is None else check_left_behind(target, document, other, kind, number)
    baked = bake_document(document, kind, source=other, across=across, **keywords)
    if target is not None:
        write_baked(target, baked, document, number, kind)
    return replace(baked, notes=[*baked.notes, *left])
