"""FORMATS: every file format, as one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from circparam.core.registry import Row, Table
from circparam.formats.document import (
    Document,
    Encoded,
    Source,
    WriteOptions,
)
from circparam.formats.gltf.document import read_gltf
from circparam.formats.gltf.export import to_glb
from circparam.formats.obj.document import read_obj
from circparam.formats.obj.export import to_obj
from circparam.formats.off import read_off
from circparam.formats.ply.document import read_ply
from circparam.formats.ply.export import to_ply
from circparam.formats.stl import read_stl
from circparam.mesh.mesh import UVMap

Export = Callable[[Document, UVMap, WriteOptions], Encoded]


@dataclass(frozen=True)
class Format:
    """One file format. Called, it reads: (data, source) → Document.

    suffixes: how names end. export: writes any document into it; None where it has no place for uv.
    output: the format that its meshes are written to when nothing is said.
    """

    read: Callable[[bytes, Source], Document]
    suffixes: tuple[str, ...]
    output: str
    export: Export | None = None

    def __call__(self, data: bytes, source: Source) -> Document:
        """Read a file of this format."""
        return self.read(data, source)


FORMATS: Table[Format] = Table(
    "format",
    Row("obj", Format(read_obj, (".obj",), "obj", to_obj),
        "Wavefront OBJ: vt lines and the vt field of f; every other byte kept"),
    Row("ply", Format(read_ply, (".ply",), "ply", to_ply),
        "PLY, ascii or binary: s, t at vertices or texcoord at faces; all properties kept"),
    Row("gltf", Format(read_gltf, (".gltf",), "gltf"),
        "glTF 2.0: TEXCOORD_n; the whole tree kept"),
    Row("glb", Format(read_gltf, (".glb", ".vrm"), "glb", to_glb),
        "binary glTF 2.0: TEXCOORD_n; the whole tree kept"),
    Row("stl", Format(read_stl, (".stl", ".stla", ".stlb"), "glb"),
        "STL: no place for uv, written as GLB"),
    Row("off", Format(read_off, (".off", ".coff"), "glb"),
        "OFF: no place for uv, written as GLB"),
)  # fmt: skip
DEFAULT_OUTPUT: dict[str, str] = {row.name: row.function.output for row in FORMATS} | {
    "arrays": "glb"
}
