"""Any document as a glTF tree with its looks: a material for each image or plain colour, vertex colours."""

from dataclasses import field

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.formats.document import Document, WriteOptions
from circparam.formats.gltf.appearance import material_table
from circparam.formats.gltf.buffers import Packing
from circparam.formats.gltf.document import GltfDocument, read_gltf
from circparam.formats.gltf.export import to_glb
from circparam.formats.gltf.model import Json
from circparam.formats.materials import linear
from circparam.formats.memory import from_arrays
from circparam.formats.shaded import split_by_normal
from circparam.mesh.mesh import UVMap


@dataclass(frozen=True, eq=False)
class Dressed:
    """document: a glTF tree. vertex: (k,) vertex of the input of each of its vertices.

    colours: (k, 3) linear, of vertices, not in the tree yet; None if the input has none, or it is a tree.
    normals: (m, 3, 3) of the corners, likewise.
    """

    document: GltfDocument
    vertex: IntArray
    colours: FloatArray | None = None
    normals: FloatArray | None = None
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def dressed(document: Document) -> Dressed:
    """A document as a glTF tree with uv, materials and textures; a glTF file is its own.

    Raises InputError for malformed materials, OutputError for positions beyond float32.
    """
    if isinstance(document, GltfDocument):
        return Dressed(document, np.arange(len(document.mesh.points)))
    mesh = document.mesh
    found = document.textures()
    layout = document.uv(0 if found is None else found.uv_set) or document.uv(0)
    has_uv = layout is not None
    layout = layout or UVMap(np.zeros((0, 2)), np.full(mesh.faces.shape, -1))
    label, materials, images, notes = material_table(found, len(mesh.faces))
    normals, vertex = document.normals(), np.arange(len(mesh.points))
    if normals is not None:
        split, vertex = split_by_normal(document, normals)
        mesh = split.mesh
    plain = from_arrays(
        mesh.points, mesh.faces, layout.uv, layout.uv_faces, groups=label, name=document.source.name
    )
    encoded = to_glb(plain, layout, WriteOptions())
    tree = _dress(read_gltf(encoded.data, document.source), materials, images, has_uv)
    colours = document.colours()
    out = None
    if colours is not None:
        out = np.ones((len(mesh.points), 3))
        out[mesh.faces.ravel()] = linear(colours.reshape(-1, 3))
        out = out[encoded.vertex_map]
    if normals is not None:
        normals = normals[encoded.face_map]
    return Dressed(tree, vertex[encoded.vertex_map], out, normals, encoded.notes, notes)


def _dress(
    document: GltfDocument, materials: list[Json], images: list[tuple[bytes, str]], has_uv: bool
) -> GltfDocument:
    """A tree that was just made, with materials and images, and without uv that nobody gave."""
    edit = Packing(document.tree)
    json = edit.json
    json["materials"] = materials
    for mesh in json["meshes"]:
        for k, primitive in enumerate(mesh["primitives"]):
            primitive["material"] = k
            if not has_uv:
                edit.replace(primitive["attributes"], "TEXCOORD_0")
    for data, kind in images:
        json.setdefault("images", []).append({"bufferView": edit.view(data), "mimeType": kind})
        texture = {"source": len(json["images"]) - 1, "sampler": 0}
        json.setdefault("textures", []).append(texture)
        json["samplers"] = [{"magFilter": 9729, "minFilter": 9987}]
    return read_gltf(edit.finish("glb", "")[0], document.source)
