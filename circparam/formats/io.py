"""Files in and out: sniff, read, encode and write through the table of formats."""

from __future__ import annotations

import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from circparam.core.arrays import IntArray
from circparam.core.files import write_files
from circparam.errors import InputError, NoResultError, OptionError
from circparam.formats.assets import find_assets, read_bytes
from circparam.formats.document import Document, Encoded, Source, WriteOptions, check_layout
from circparam.formats.gltf.document import read_gltf
from circparam.formats.gltf.editing import stored_uv
from circparam.formats.gltf.export import to_glb
from circparam.formats.ply.document import PlyDocument
from circparam.formats.table import DEFAULT_OUTPUT, FORMATS
from circparam.mesh.mesh import UVMap


@dataclass(frozen=True)
class Written:
    """What was written: path (None for standard output), all files, notes, and the index maps.

    vertex_map: (k,) int64 input vertex of every output vertex. face_map: (m,) int64 input face of every
    output face.
    """

    path: Path | None
    files: list[Path]
    notes: list[str]
    vertex_map: IntArray
    face_map: IntArray


def format_of(path: str | os.PathLike[str], format: str | None = None) -> str:
    """The format by name: as given, else by the suffix. Raises OptionError where neither tells."""
    if format is not None:
        FORMATS[format.lower()]
        return format.lower()
    suffix = Path(path).suffix.lower()
    for row in FORMATS:
        if suffix in row.function.suffixes:
            return row.name
    known = ", ".join(s for row in FORMATS for s in row.function.suffixes[:1])
    what = (
        f"the suffix {suffix!r} is no mesh format"
        if suffix
        else "there is no suffix that tells the format"
    )
    raise OptionError(f"{os.fspath(path)}: {what}; end it in {known} or give --format")


def sniff(data: bytes) -> str | None:
    """The format that the first bytes give away; None where they do not."""
    head = data[:2048]
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if head[:4] == b"glTF":
        return "glb"
    if re.match(rb"ply[ \t]*[\r\n]", head):
        return "ply"
    if re.match(rb"(?:ST)?C?N?OFF\b", text):
        return "off"
    if text[:1] == b"{" and b'"' in text:
        return "gltf"
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return "stl"
    if re.match(rb"solid\b[^\0]*?\bfacet\s+normal", text, re.S):
        return "stl"
    if b"\0" not in head and re.search(rb"^[ \t]*v[ \t]+[-+.\d]", data[: 1 << 20], re.M):
        return "obj"
    return None


def read(
    path: str | os.PathLike[str], *, format: str | None = None, unshare: bool = False
) -> Document:
    """Read a mesh file; ``-`` is standard input.

    format: a name of ``FORMATS``; else the content tells, and where it does not, the suffix. unshare: glTF
    meshes that several nodes use become copies, one for each node.
    Raises InputError where the file is missing, unreadable, malformed, without faces, or holds NaN, or where
    its name says another format than its content.
    """
    data, source = read_bytes(path)
    return read_data(data, source, format=format, unshare=unshare)


def read_data(
    data: bytes, source: Source | None = None, *, format: str | None = None, unshare: bool = False
) -> Document:
    """Read a mesh from bytes; see ``read``."""
    source = source or Source("the given data")
    if format is None:
        name = sniff(data)
        try:
            by_suffix = format_of(source.path) if source.path is not None else None
        except OptionError as error:
            by_suffix = None
            if name is None:
                raise InputError(str(error)) from None
        if name is None and by_suffix is None:
            raise source.error("the content tells no mesh format; give --format")
        if name and by_suffix and name != by_suffix:
            raise source.error(
                f"the name says {by_suffix.upper()}, the content is {name.upper()}: "
                "rename it to what it holds"
            )
        name = name or by_suffix or ""
    else:
        name = format_of("", format)
    try:
        if unshare and name in ("gltf", "glb"):
            document: Document = read_gltf(data, source, unshare=True)
        else:
            document = FORMATS[name].function(data, source)
    except InputError as error:
        if str(error).startswith(source.name):
            raise
        raise source.error(error) from None
    except (MemoryError, RecursionError) as error:
        raise source.error(
            f"it asks for more memory than there is ({type(error).__name__})"
        ) from None
    return document


def stored(uvmap: UVMap, format: str, document: Document | None = None) -> UVMap:
    """The layout as it is after being written to a format and read back.

    OBJ keeps every digit; glTF stores float32 u and 1 − v; PLY float32, or doubles where the document has
    doubles. Flips and overlaps are to be checked on these numbers.
    """
    uv = np.ascontiguousarray(uvmap.uv, np.float64) + 0.0
    if format in ("gltf", "glb"):
        uv = stored_uv(uv)
    elif format == "ply":
        kind = document.uv_type if isinstance(document, PlyDocument) else "f4"
        uv = uv.astype(kind).astype(np.float64) + 0.0
    elif format != "obj":
        raise OptionError(f"{format.upper()} has no place for uv: write obj, ply, gltf or glb")
    return UVMap(uv, uvmap.uv_faces)


def encode(
    document: Document, uvmap: UVMap, format: str, *,
    options: WriteOptions | None = None, stem: str = "",
) -> Encoded:  # fmt: skip
    """The document with uv as bytes, nothing on the disk touched; ``stem`` names further files."""
    options = options or WriteOptions()
    row = FORMATS[format]
    uvmap = check_layout(document, uvmap)
    encoded = document.rewrite(uvmap, options, format, stem)
    if encoded is not None:
        return encoded
    if format == "gltf":
        encoded = _as_gltf(document, uvmap, options, stem)
    elif row.function.export is None:
        raise OptionError(f"{format.upper()} has no place for uv: write obj, ply, gltf or glb")
    else:
        encoded = row.function.export(document, uvmap, options)
    return encoded


def _as_gltf(document: Document, uvmap: UVMap, options: WriteOptions, stem: str) -> Encoded:
    """A new glTF: the GLB of it, taken apart."""
    encoded = to_glb(document, uvmap, options)
    again = read_gltf(encoded.data, Source("memory"))
    whole = again.uv()
    if whole is None:
        raise NoResultError("the new glTF has no uv")
    out = again.rewrite(whole, WriteOptions(), "gltf", stem)
    if out is None:
        raise NoResultError("the new glTF can't be written")
    encoded.data, encoded.extra, encoded.format = out.data, out.extra, "gltf"
    return encoded


def write(
    path: str | os.PathLike[str], document: Document, uvmap: UVMap, *,
    format: str | None = None, options: WriteOptions | None = None, overwrite: bool = False,
) -> Written:  # fmt: skip
    """Write the document with uv; ``-`` is standard output. All files appear whole or not at all.

    format: a name of ``FORMATS``; else the suffix tells, and for ``-`` the input's own format.
    Raises OptionError where the file exists or an option does not apply, NoResultError where the layout does
    not fit, OutputError where the disk refuses.
    """
    options = options or WriteOptions()
    if os.fspath(path) == "-":
        name = format_of("", format or DEFAULT_OUTPUT[document.format])
        encoded = encode(document, uvmap, name, options=options)
        sys.stdout.buffer.write(encoded.data)
        sys.stdout.buffer.flush()
        return Written(None, [], encoded.notes, encoded.vertex_map, encoded.face_map)
    target = Path(path)
    name = format_of(target, format)
    if target.exists() and not overwrite:  # before the work, not after it
        raise OptionError(f"{target}: the file exists; replace it with --overwrite")
    encoded = encode(document, uvmap, name, options=options, stem=target.stem)
    assets, missing = find_assets(document.source, encoded, target, options.copy_assets)
    beside = {target.parent / name: data for name, data in encoded.extra.items()}
    # the file itself comes last: what it refers to is there before it
    files = write_files({**assets, **beside, target: encoded.data}, overwrite)[::-1]
    return Written(target, files, [*encoded.notes, *missing], encoded.vertex_map, encoded.face_map)
