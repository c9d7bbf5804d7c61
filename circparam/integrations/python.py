"""What ``import circparam`` offers: the functions of the pipeline, options typed, errors in words of Python."""

from __future__ import annotations

import dataclasses
import inspect as introspection
import os
from collections.abc import Callable
from typing import Any, Literal, TypeVar, Unpack

from circparam.core.monitor import Listener
from circparam.formats import io
from circparam.formats.document import Document, WriteOptions
from circparam.integrations.keywords import Keywords
from circparam.integrations.words import python_words
from circparam.mesh.mesh import UVMap
from circparam.pipeline import inspect as looking
from circparam.pipeline import save as saving
from circparam.pipeline import unwrap as unwrapping
from circparam.pipeline.options import Options
from circparam.pipeline.result import Result

F = TypeVar("F", bound=Callable[..., Any])


def with_options(function: F) -> F:
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


@with_options
@python_words
def unwrap(
    source: Any,
    output: str | os.PathLike[str] | None = None,
    *,
    listener: Listener | None = None,
    options: Options | None = None,
    **keywords: Unpack[Keywords],
) -> Result:
    """Give a mesh a uv layout.

    source: a path, a ``Document``, a ``Mesh``, a pair (points (n, 3), faces (m, 3)) of arrays, or a
    trimesh.Trimesh or Scene; never changed. output: file to write (read back and verified); None keeps the
    layout in memory. listener: called with (stage, fraction, note). keywords: the fields of ``Options``, or
    ``options``: one such value.

    Returns a Result. Raises OptionError, InputError, TopologyError, NoResultError, OutOfTimeError, OutputError:
    see ``circparam.errors``.
    """
    return unwrapping.unwrap(source, output, listener=listener, options=options, **keywords)


@with_options
@python_words
def repack(
    source: Any,
    output: str | os.PathLike[str] | None = None,
    *,
    listener: Listener | None = None,
    **keywords: Unpack[Keywords],
) -> Result:
    """Pack the charts that a file's uv has already; their shapes and relative sizes stay as they are.

    source, output, listener: as for ``unwrap``. keywords: the fields of ``Options`` for packing and writing;
    uv_set is the set that is read and replaced. Raises InputError where a face has no uv.
    """
    return unwrapping.repack(source, output, listener=listener, **keywords)


@python_words
def inspect(
    document: Document,
    *,
    uv_set: int | None = None,
    weld: float = 0.0,
    resolution: int = 2048,
    padding: int = 4,
) -> looking.Inspection:
    """Describe a document; with ``uv_set`` judge that set at a resolution in texels.

    Raises InputError where the set does not exist, or no face has uv in it, OptionError for a resolution or
    padding (texels) out of range.
    """
    return looking.inspect(
        document, uv_set=uv_set, weld=weld, resolution=resolution, padding=padding
    )


@python_words
def read(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    unshare: bool = False,
    reader: Literal["own", "trimesh"] | None = None,
) -> Document:
    """Read a mesh file; ``-`` is standard input.

    format: its name ('obj', 'ply' ...); else the content tells, and where it does not, the suffix. unshare:
    meshes that several nodes use (glTF) become copies, one for each node. reader: 'trimesh' reads geometry and
    uv through trimesh, whatever the format. Raises InputError where the file is
    missing, unreadable, malformed, without faces, or holds NaN.
    """
    return io.read(path, format=format, unshare=unshare, reader=reader)


@python_words
def write(
    path: str | os.PathLike[str],
    document: Document,
    uvmap: UVMap,
    *,
    format: str | None = None,
    options: WriteOptions | None = None,
    overwrite: bool = False,
) -> io.Written:
    """Write the document with uv; ``-`` is standard output. All files appear whole or not at all.

    Raises OptionError where the file exists or an option does not apply, NoResultError where the layout does
    not fit, OutputError where the disk refuses.
    """
    return io.write(path, document, uvmap, format=format, options=options, overwrite=overwrite)


@python_words
def save(result: Result, output: str | os.PathLike[str]) -> Result:
    """Write a result, read the file back and verify that; the result of the file.

    Raises OutputError where the disk refuses, OptionError where the file exists, NoResultError where what was
    written cannot be read back.
    """
    return saving.save(result, output)
