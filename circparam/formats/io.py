"""Files in and out: sniff, read, encode and write through the table of formats.

Texts with a line that never ends are refused while they are read, before they fill the memory: a word takes 16
bytes beside its own, so a line of gigabytes takes tens of them, and no mesh has such a line.
"""

import contextlib
import functools
import io
import itertools
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from circparam.core.files import check_free, write_files
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, OptionError
from circparam.formats.assets import check_needed, find_assets, unresolved
from circparam.formats.document import Document, Encoded, WriteOptions, check_layout, check_new_set
from circparam.formats.foreign import read_through_trimesh
from circparam.formats.source import Source, read_bytes, regular_bytes
from circparam.formats.table import (
    FORMATS,
    Format,
    axis_up,
    default_output,
    format_by_suffix,
    sniff,
    up_of,
    writable,
)
from circparam.mesh.mesh import UVMap

PEEKED_BYTES = 1 << 20  # bytes of each end of a large file that are looked at before it is read
BLOCK_BYTES = 1 << 20  # bytes that are looked at in one go
LONGEST_LINE_BYTES = 1 << 24  # bytes; a polygon of a million corners takes as many
# Bytes of a line for each byte before it. A row of a mesh names vertices whose own rows, longer than
# their numbers, stand before it. A strip of a whole mesh names each about six times, as triangles do.
LINE_BYTES_PER_BYTE = 6


@dataclass(frozen=True)
class Written:
    """The written output: path (None for standard output), all files, notes, and the index maps.

    warnings: changes for the user; notes: of interest. contents: what all files will hold, by their place, the
    mesh last, as long as nothing touches the disk. there: files that it refers to and that lie in their place.

    vertex_map: (k,) int64 input vertex of every output vertex. face_map: (m,) int64 input face of every
    output face.
    """

    path: Path | None
    files: list[Path]
    notes: list[str]
    vertex_map: IntArray
    face_map: IntArray
    warnings: list[str] = field(default_factory=list)
    contents: dict[Path, bytes] = field(default_factory=dict, repr=False)
    there: list[Path] = field(default_factory=list)


_GLB = "export a .glb (or .obj) there, and unwrap that"


# files that people give in place of a readable mesh → cure
_FOREIGN = {
    ".fbx": (
        "FBX is a closed format; Blender makes a GLB of it, unwrap that: blender -b --python-expr "
        '"import bpy; bpy.ops.wm.read_factory_settings(use_empty=True); '
        "bpy.ops.wm.fbx_import(filepath='MESH.fbx'); bpy.ops.export_scene.gltf(filepath='MESH.glb')\""
    ),
    ".blend": f"a Blender file holds more than a mesh: open it in Blender, {_GLB}",
    ".3ds": f"3DS is not read: open it in Blender, {_GLB}",
    ".abc": f"Alembic is not read: open it in Blender, {_GLB}",
    ".max": f"a 3ds Max scene holds more than a mesh: open it there, {_GLB}",
    **dict.fromkeys((".ma", ".mb"), f"a Maya scene holds more than a mesh: open it there, {_GLB}"),
    **dict.fromkeys(
        (".iges", ".igs"),
        "IGES holds surfaces, no triangles: export an .stl or .obj from the CAD program",
    ),
    ".mtl": "this is a material library: give the .obj that names it",
    ".bin": "this is a buffer of a glTF: give the .gltf that names it",
    ".zip": "this is an archive: unpack it, and give the mesh inside",
}


def output_format(path: str | os.PathLike[str]) -> str:
    """The format of an output by the suffix of its name. Raises OptionError for one that holds no uv."""
    suffix = Path(path).suffix.lower()
    row = format_by_suffix(suffix)
    if row is not None and row.function.export is not None:
        return row.name
    *most, last = [FORMATS[name].function.suffixes[0] for name in writable()]
    what = f"{suffix[1:].upper()} holds no uv here" if suffix else "the name has no suffix"
    raise OptionError(
        f"{os.fspath(path)}: {what}; the name must end in {', '.join(most)} or {last}"
    )


def format_of(path: str | os.PathLike[str], format: str | None = None) -> str:
    """The format by name: as given, else by the suffix. Raises OptionError if neither tells."""
    if format is not None:
        return FORMATS[format.lower()].name
    suffix = Path(path).suffix.lower()
    if row := format_by_suffix(suffix):
        return row.name
    known = ", ".join(row.function.suffixes[0] for row in FORMATS)
    what = f"the suffix {suffix!r} is not a mesh format" if suffix else "the name has no suffix"
    raise OptionError(f"{os.fspath(path)}: {what}; end it in {known} or give --format")


def read(
    path: str | os.PathLike[str], *, format: str | None = None, unshare: bool = False,
    reader: str | None = None,
) -> Document:  # fmt: skip
    """Read a mesh file; ``-`` is standard input.

    format: a name of ``FORMATS``; else the content tells, and where it does not, the suffix. unshare: meshes
    that several nodes use (glTF) become copies, one for each node; other formats are read as ever. reader:
    'trimesh' reads geometry and uv through trimesh, whatever there is of an own reader.
    Raises InputError if the file is missing, unreadable, malformed, without faces, or holds NaN, or where
    its name says another format than its content.
    """
    try:
        place = Path(path)
    except TypeError:
        raise InputError(
            f"a {type(path).__name__} is no path of a file: arrays and trimesh objects need no reading"
        ) from None
    if os.fspath(path) != "-":
        _peek(place, format)
    data, source = read_bytes(path, functools.partial(_blocks_of_input, format=format))
    return read_data(data, source, format=format, unshare=unshare, reader=reader)


def _peek(path: Path, format: str | None) -> None:
    """Refuse a large file that its ends tell to be broken, or that has an endless line, instead of filling the
    memory with it first."""
    with contextlib.suppress(OSError, ValueError):  # reading will say it
        size = os.stat(path).st_size
        if size < LONGEST_LINE_BYTES or not path.is_file():
            return
        source = Source(os.fspath(path), path)
        with path.open("rb") as file:
            head = file.read(PEEKED_BYTES)
            row = _row_of(head, format, path.suffix)
            if row is None:
                return
            if row.peek is not None:
                file.seek(max(size - PEEKED_BYTES, 0))
                row.peek(head, file.read(), size, source)
            if row.lined(head):
                file.seek(0)
                check_lines(blocks_in(file), source)


def _blocks_of_input(file: BinaryIO, format: str | None) -> Iterator[bytes]:
    """Standard input block by block; InputError as soon as a line has no end."""
    head = file.read(PEEKED_BYTES)
    row = _row_of(head, format, "")
    blocks = itertools.chain([head], blocks_in(file))
    lined = row is not None and row.lined(head)
    return limited(blocks, Source("standard input")) if lined else blocks


def _row_of(head: bytes, format: str | None, suffix: str) -> Format | None:
    """The reader of a file that begins so, judged by these bytes and its suffix."""
    name = sniff(head) if format is None else format_of("", format)
    row = FORMATS[name] if name is not None else format_by_suffix(suffix)
    return None if row is None else row.function


def read_data(
    data: bytes, source: Source | None = None, *, format: str | None = None, unshare: bool = False,
    reader: str | None = None,
) -> Document:  # fmt: skip
    """Read a mesh from bytes; see ``read``."""
    source = source or Source("the given data")
    name = _format_of_content(data, source) if format is None else format_of("", format)
    if FORMATS[name].function.lined(data[:PEEKED_BYTES]):
        check_lines(blocks_in(io.BytesIO(data)), source)
    if reader == "trimesh":
        return read_through_trimesh(data, source, name)
    row = FORMATS[name].function
    read_it = row.unshare if unshare and row.unshare is not None else row.read
    try:
        return read_it(data, source)
    except InputError as error:
        line = str(error) if str(error).startswith(source.name) else str(source.error(error))
        raise InputError(line) from None
    except (MemoryError, RecursionError) as error:
        raise source.error(
            f"it asks for more memory than there is ({type(error).__name__})"
        ) from None


def _format_of_content(data: bytes, source: Source) -> str:
    """The format by content, or else by suffix. Raises InputError if they differ or neither tells."""
    name, suffix = sniff(data), "" if source.path is None else source.path.suffix.lower()
    row = format_by_suffix(suffix)
    if row is None and name is not None:
        return name
    if row is None:
        if source.path is None:
            raise source.error("the content matches no mesh format; give --format")
        if suffix in _FOREIGN:
            raise InputError(f"{source.name}: {_FOREIGN[suffix]}")
        try:
            return format_of(source.path)
        except OptionError as error:
            raise InputError(str(error)) from None
    if name is None:
        return row.name
    if name != row.name and suffix not in FORMATS[name].function.also:
        raise source.error(
            f"the name says {row.name.upper()}, the content is {name.upper()}: rename it to what it holds"
        )
    return name


def stored(uvmap: UVMap, format: str, document: Document | None = None) -> UVMap:
    """The layout after writing and reading in a format, as its row rounds uv.

    Checks of flips and overlaps need these numbers. Raises OptionError for a format without uv.
    """
    return UVMap(rounding(format, document)(uvmap.uv), uvmap.uv_faces)


def rounding(
    format: str, document: Document | None = None, double: bool = False
) -> Callable[[FloatArray], FloatArray]:
    """The function (k, 2) → (k, 2) that rounds uv to the nearest numbers a format can store.

    double: as ``WriteOptions.uv_double``; where the format has no doubles, the same as without.
    Raises OptionError for a format without uv.
    """
    row = FORMATS[format].function
    round_uv = row.round_double if double and row.round_double is not None else row.round_uv
    if round_uv is None:
        raise _no_place(format)

    def rounded(uv: FloatArray) -> FloatArray:
        uv = np.ascontiguousarray(uv, np.float64) + 0.0
        own = None if document is None else document.rounded(uv)
        return round_uv(uv, document) if own is None else own

    return rounded


def has_doubles(format: str) -> bool:
    """Whether a format can store uv as doubles on request."""
    return FORMATS[format].function.round_double is not None


def encode(
    document: Document, uvmap: UVMap, format: str, *,
    options: WriteOptions | None = None, stem: str = "",
) -> Encoded:  # fmt: skip
    """The document with uv as bytes, nothing on the disk touched; ``stem`` names further files."""
    options = options or WriteOptions()
    export = FORMATS[format].function.export
    uvmap = check_layout(document, uvmap)
    encoded = document.rewrite(uvmap, options, format, stem)
    if encoded is not None:
        return encoded
    if export is None:
        raise _no_place(format)
    check_new_set(options, format)
    up = options.up or axis_up(document) or "y"
    return export(document, uvmap, replace(options, up=up), stem)


def _no_place(format: str) -> OptionError:
    *most, last = writable()
    return OptionError(f"{format.upper()} has no place for uv: write {', '.join(most)} or {last}")


def write(
    path: str | os.PathLike[str], document: Document, uvmap: UVMap, *,
    format: str | None = None, options: WriteOptions | None = None, overwrite: bool = False,
) -> Written:  # fmt: skip
    """Write the document with uv; ``-`` is standard output. All files appear whole or not at all.

    format: a name of ``FORMATS``; else the suffix tells, and for ``-`` the input's own format.
    Raises OptionError if the file exists or an option does not apply, NoResultError if the layout does
    not fit, OutputError if the disk refuses.
    """
    options = options or WriteOptions()
    if os.fspath(path) == "-":
        name = format_of("", format or default_output(document.format))
        encoded = encode(document, uvmap, name, options=options)
        sys.stdout.buffer.write(encoded.data)
        sys.stdout.buffer.flush()
        warnings = [*encoded.warnings, *unresolved(encoded, document.source)]
        return Written(None, [], encoded.notes, encoded.vertex_map, encoded.face_map, warnings)
    staged = stage(path, document, uvmap, format=format, options=options, overwrite=overwrite)
    return write_staged([staged], overwrite)[0]


def stage(
    path: str | os.PathLike[str], document: Document, uvmap: UVMap, *,
    format: str | None = None, options: WriteOptions | None = None, overwrite: bool = False,
) -> Written:  # fmt: skip
    """The files that ``write`` would write. Raises the errors of ``write``."""
    options = options or WriteOptions()
    target = Path(path)
    name = format_of(target, format)
    check_place(target, document, name, overwrite)
    encoded = encode(document, uvmap, name, options=options, stem=target.stem)
    copies, there, unfound = find_assets(
        document.source, encoded, target, options.copy_assets, overwrite
    )
    beside = {target.parent / name: data for name, data in encoded.extra.items()}
    # the file itself comes last: the files that it refers to exist before it
    contents = {**copies, **beside, target: encoded.data}
    return Written(
        target, list(contents)[::-1], encoded.notes, encoded.vertex_map, encoded.face_map,
        [*encoded.warnings, *unfound], contents, there,
    )  # fmt: skip


def write_staged(outputs: Sequence[Written], overwrite: bool) -> list[Written]:
    """Write several outputs into one folder, all or none; files that are the same in two of them once.

    Raises OptionError if different files have one place, and the errors of ``write``.
    """
    contents: dict[Path, bytes] = {}
    place: dict[Path, Path] = {}
    there = {path.resolve() for output in outputs for path in output.there}
    for output in outputs:
        for path, data in output.contents.items():
            known = place.setdefault(path.resolve(), path)
            other = regular_bytes(path) if path.resolve() in there else data
            if contents.setdefault(known, data) != data or other != data:
                raise OptionError(
                    f"{path}: two outputs need a file of that name, and theirs differ: rename one of them"
                )
    folder = next((o.path.resolve().parent for o in outputs if o.path), None)
    write_files(contents, overwrite, inside=folder)
    return [replace(output, contents={}) for output in outputs]


def check_target(document: Document, format: str, options: WriteOptions) -> None:
    """Refuse an output that has no place for the uv asked for, before the work for them.

    Raises OptionError.
    """
    useless = options.up is not None and not options.turned_by_up
    if useless and up_of(format) != "y":
        raise OptionError(
            f"--up has no effect here: {format.upper()} keeps the axes of the input; leave it out"
        )
    if document.check_target(options, format):
        if useless:
            raise OptionError("--up has no effect here: a glTF stays as it stands; leave it out")
        return
    row = FORMATS[format].function
    if row.export is None:
        raise _no_place(format)
    if row.require is not None:
        row.require()
    check_new_set(options, format)


def check_place(
    path: str | os.PathLike[str], document: Document, format: str, overwrite: bool
) -> None:
    """Refuse an output before its work if an existing file may not be replaced.

    Raises OptionError.
    """
    target = Path(path)
    check_free(target, overwrite)
    check_needed(document, format, target, overwrite)


def blocks_in(file: BinaryIO) -> Iterator[bytes]:
    """The rest of a file, block by block."""
    return iter(lambda: file.read(BLOCK_BYTES), b"")


def limited(blocks: Iterable[bytes], source: Source) -> Iterator[bytes]:
    """The blocks of a text, of at most ``BLOCK_BYTES`` each; InputError for a line too long for any mesh.

    Nothing behind the first block of such a line is asked for.
    """
    read = begin = newlines = returns = 0
    for block in blocks:
        ends = block.find(b"\n"), block.find(b"\r")
        first = min((k for k in ends if k >= 0), default=len(block))
        longest = max(LONGEST_LINE_BYTES, LINE_BYTES_PER_BYTE * begin)
        if read + first - begin > longest:
            line = 1 + (newlines or returns)
            raise source.error(
                f"line {line} is longer than {longest >> 20} MB: no mesh has such lines"
            )
        newlines += block.count(b"\n")
        returns += block.count(b"\r")
        if first < len(block):
            begin = read + 1 + max(block.rfind(b"\n"), block.rfind(b"\r"))
        read += len(block)
        yield block


def check_lines(blocks: Iterable[bytes], source: Source) -> None:
    """Refuse a text with an endless line. Raises InputError."""
    for _ in limited(blocks, source):
        pass
