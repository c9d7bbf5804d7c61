"""FORMATS: every file format, as one table; all that the rest of the package knows of a format is its row."""

import re
from collections.abc import Callable
from functools import partial

import numpy as np

from circparam.core.records import dataclass
from circparam.core.registry import Row, Table
from circparam.core.types import FloatArray
from circparam.formats.document import Document, Encoded, WriteOptions
from circparam.formats.foreign import read_through_trimesh
from circparam.formats.gltf.document import read_gltf
from circparam.formats.gltf.editing import stored_uv
from circparam.formats.gltf.export import to_gltf
from circparam.formats.obj.document import read_obj, to_obj
from circparam.formats.off import read_off
from circparam.formats.ply.document import read_ply, round_ply, to_ply
from circparam.formats.ply.reading import is_ascii
from circparam.formats.ply.reading import look_ahead as look_ahead_ply
from circparam.formats.source import Source
from circparam.formats.stl import is_text_stl, read_stl
from circparam.formats.stl import look_ahead as look_ahead_stl
from circparam.formats.tokens import BYTE_ORDER_MARK
from circparam.formats.usd.document import read_usd
from circparam.formats.usd.stage import is_crate, is_package, is_text, require_usd
from circparam.formats.usd.writing import to_usd
from circparam.mesh.mesh import UVMap

SNIFFED_BYTES = 2048  # bytes at the beginning that most formats are recognised by
SNIFFED_OBJ_BYTES = 1 << 20  # an OBJ may begin with a long comment before its first v line

Read = Callable[[bytes, Source], Document]
Export = Callable[[Document, UVMap, WriteOptions, str], Encoded]
RoundUV = Callable[[FloatArray, Document | None], FloatArray]


@dataclass(frozen=True)
class Format:
    """One file format. Called, it reads: (data, source) → Document.

    suffixes: how names end. sniff: whether content is of this format. rank: rows of lower rank are asked first;
    0 for a magic number at the beginning, more where the evidence is weaker. export: (document, layout,
    options, stem of further files) → the file; writes any document into the format, None if it has no place
    for uv. round_uv: (uv (k, 2), document or None) → the uv after writing and reading, each coordinate by
    itself; the document only if it has this format. round_double: the same with uv in doubles, where the format
    can hold them (``WriteOptions.uv_double``). output: the format that its meshes are written to when nothing
    is said, '' for itself. unshare: reads with meshes that several nodes use copied for each; None if meshes
    of the format cannot be shared. peek:
    (first bytes, last bytes, size, source), raises InputError if these tell that a large file is not worth
    reading. lined: whether a file of the format that begins so is text in lines, of which none may be endless.
    up: the axis that points up in meshes of the format, '' if nothing says which. also: suffixes of other
    rows that files of this content may have too. require: raises OptionError if a package is missing that
    writes the format.
    """

    read: Read
    suffixes: tuple[str, ...]
    sniff: Callable[[bytes], bool]
    rank: int = 0
    export: Export | None = None
    round_uv: RoundUV | None = None
    round_double: RoundUV | None = None
    output: str = ""
    unshare: Read | None = None
    peek: Callable[[bytes, bytes, int, Source], None] | None = None
    lined: Callable[[bytes], bool] = lambda head: False
    up: str = ""
    also: tuple[str, ...] = ()
    require: Callable[[], None] | None = None

    def __call__(self, data: bytes, source: Source) -> Document:
        """Read a file of this format."""
        return self.read(data, source)


def _begins(pattern: bytes) -> Callable[[bytes], bool]:
    """Whether a text begins with a pattern, behind a byte order mark and blanks."""

    def begins(data: bytes) -> bool:
        text = data[:SNIFFED_BYTES].removeprefix(BYTE_ORDER_MARK).lstrip(b" \t\r\n")
        return re.match(pattern, text, re.S) is not None

    return begins


def _zipped(name: bytes) -> Callable[[bytes], bool]:
    """Whether an archive holds a file whose name ends so."""
    return lambda data: data[:2] == b"PK" and name in data


def _is_stl(data: bytes) -> bool:
    """By the size that a binary file must have for its number of triangles, or the first words of a text."""
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return True
    return _begins(rb"solid\b[^\0]*?\bfacet\s+normal")(data)


def _is_obj(data: bytes) -> bool:
    """By the first line with a vertex: OBJ has no beginning of its own."""
    if b"\0" in data[:SNIFFED_BYTES]:
        return False
    return re.search(rb"^[ \t]*v[ \t]+[-+.\d]", data[:SNIFFED_OBJ_BYTES], re.M) is not None


def _always(head: bytes) -> bool:
    return True


def _as_it_is(uv: FloatArray, document: Document | None) -> FloatArray:
    return uv


def _as_float32(uv: FloatArray, document: Document | None) -> FloatArray:
    return uv.astype(np.float32).astype(np.float64)


def _as_gltf(uv: FloatArray, document: Document | None) -> FloatArray:
    return stored_uv(uv)


def _foreign(
    name: str,
    sniff: Callable[[bytes], bool],
    rank: int = 0,
    up: str = "",
    also: tuple[str, ...] = (),
) -> Format:
    """A format that trimesh reads: geometry and uv only."""
    read = partial(read_through_trimesh, kind=name)
    return Format(read, (f".{name}", *also), sniff, rank, output="glb", up=up)


def _usd(
    kind: str, suffixes: tuple[str, ...], sniff: Callable[[bytes], bool], also: tuple[str, ...] = ()
) -> Format:
    """A kind of USD file, read and written with usd-core."""
    return Format(read_usd, suffixes, sniff, export=partial(to_usd, kind=kind), round_uv=_as_float32,
                  also=also, require=require_usd)  # fmt: skip


FORMATS: Table[Format] = Table(
    "format",
    Row("obj", Format(read_obj, (".obj",), _is_obj, rank=3, export=to_obj, round_uv=_as_it_is,
                      lined=_always),
        "Wavefront OBJ: vt lines and the vt field of f; every other byte kept"),
    Row("ply", Format(read_ply, (".ply",), lambda data: re.match(rb"ply[ \t]*[\r\n]", data) is not None,
                      export=to_ply, round_uv=round_ply, round_double=_as_it_is, peek=look_ahead_ply,
                      lined=is_ascii, up="z"),
        "PLY, ascii or binary: s, t at vertices or texcoord at faces; all properties kept"),
    Row("gltf", Format(read_gltf, (".gltf",), _begins(rb'\{.*"'), rank=1, export=to_gltf,
                       round_uv=_as_gltf, unshare=partial(read_gltf, unshare=True), up="y"),
        "glTF 2.0: TEXCOORD_n; the whole tree kept"),
    Row("glb", Format(read_gltf, (".glb", ".vrm"), lambda data: data[:4] == b"glTF",
                      export=partial(to_gltf, format="glb"), round_uv=_as_gltf,
                      unshare=partial(read_gltf, unshare=True), up="y"),
        "binary glTF 2.0: TEXCOORD_n; the whole tree kept"),
    Row("usda", _usd("usda", (".usda",), is_text, also=(".usd",)),
        "USD as text, with usd-core: primvars:st in a layer over the layers of the file"),
    Row("usdc", _usd("usdc", (".usdc", ".usd"), is_crate), "binary USD: the same"),
    Row("usdz", _usd("usdz", (".usdz",), is_package),
        "a package of USD: the same, in a package with all that was in it"),
    Row("stl", Format(read_stl, (".stl", ".stla", ".stlb"), _is_stl, rank=2, output="glb",
                      peek=look_ahead_stl, lined=is_text_stl, up="z"),
        "STL: no place for uv, written as GLB"),
    Row("off", Format(read_off, (".off", ".coff"), _begins(rb"(?:ST)?C?N?OFF\b"), output="glb",
                      lined=_always),
        "OFF: no place for uv, written as GLB"),
    Row("3mf", _foreign("3mf", _zipped(b".model"), up="z"), "3MF through trimesh, written as GLB"),
    Row("dae", _foreign("dae", _begins(rb".*<COLLADA\b"), 1), "COLLADA through trimesh, written as GLB"),
    Row("zae", _foreign("zae", _zipped(b".dae")), "zipped COLLADA through trimesh, written as GLB"),
    Row("xaml", _foreign("xaml", _begins(rb"<[^>]*schemas\.microsoft\.com/winfx"), 1),
        "XAML through trimesh, written as GLB"),
    Row("step", _foreign("step", _begins(rb"ISO-10303-21;"), up="z", also=(".stp",)),
        "STEP through trimesh and cascadio, written as GLB"),
)  # fmt: skip


def default_output(format: str) -> str:
    """The format that a document of a format (or of arrays) is written to when nothing is said."""
    return "glb" if format == "arrays" else FORMATS[format].function.output or format


def format_by_suffix(suffix: str) -> Row[Format] | None:
    """The row of the format whose names end so; None if there is none."""
    return next((row for row in FORMATS if suffix.lower() in row.function.suffixes), None)


def output_suffix(suffix: str) -> str:
    """The default suffix of an output: the suffix of the input if its format has uv."""
    row = format_by_suffix(suffix)
    return f".{row.function.output}" if row is not None and row.function.output else suffix


def up_of(format: str) -> str:
    """The axis that points up in meshes of a format, as Blender reads them too; '' if nothing says which."""
    return FORMATS[format].function.up if format in FORMATS else ""


def axis_up(document: Document) -> str:
    """The axis that points up: as the file says, else as its format has it; empty if nothing says which."""
    return document.up or up_of(document.format)


def takes_unshare(format: str) -> bool:
    """Whether meshes of a format can be shared by several nodes, and so be copied for each."""
    return format in FORMATS and FORMATS[format].function.unshare is not None


def writable() -> list[str]:
    """The formats that have a place for uv, in the order of the table."""
    return [row.name for row in FORMATS if row.function.export is not None]


def sniff(data: bytes) -> str | None:
    """The format that the content identifies; None if it identifies none."""
    rows = sorted(FORMATS, key=lambda row: row.function.rank)
    return next((row.name for row in rows if row.function.sniff(data)), None)
