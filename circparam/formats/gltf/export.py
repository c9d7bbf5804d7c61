"""Any document as a new GLB or glTF, with its materials, images, colours and normals."""

import json
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import mask_of
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, OutputError
from circparam.formats.document import (
    Document,
    Encoded,
    WriteOptions,
    exported_grouping,
    not_carried,
    y_up,
)
from circparam.formats.gltf.buffers import Packing
from circparam.formats.gltf.document import store_layout
from circparam.formats.gltf.editing import file_uv, stored_uv
from circparam.formats.gltf.reading import Json, Tree
from circparam.formats.gltf.scene import unit_rows
from circparam.formats.materials import Textures, decode, encoded_image, linear, media_type
from circparam.formats.source import Source
from circparam.formats.vertex_split import Split, duplicated, split_vertices
from circparam.mesh.mesh import Mesh, UVMap


@dataclass(frozen=True, eq=False)
class Appearance:
    """Materials, images and attributes of a tree from a document.

    label: (m,) material of each face, in the order of the groups. images: with their media types. uv: the
    layout that the images were drawn for, None if there are none. colours: (m, 3, 3) linear, of the corners;
    normals: (m, 3, 3), unit; None if the document has none. warnings: missing parts. carried: the features
    that are there now.
    """

    label: IntArray
    materials: list[Json]
    images: list[tuple[bytes, str]]
    uv: UVMap | None
    colours: FloatArray | None
    normals: FloatArray | None
    warnings: list[str]
    carried: list[str]


def appearance_of(document: Document, with_colours: bool) -> Appearance:
    """The appearance of a document. with_colours: False leaves images and vertex colours out.

    A bad description in the document becomes a warning, because the mesh can still be written.
    """
    warnings: list[str] = []
    found = colours = uv = None
    images: list[tuple[bytes, str]] = []
    if with_colours:
        try:
            found = document.textures()
            colours = document.colours()
        except InputError as error:
            warnings.append(str(error))
    if found is not None and found.images:
        uv = document.uv(found.uv_set)
        if uv is None:
            warnings.append("its textures refer to uv that it lacks, and were left out")
            found = None
    if found is not None:
        warnings += found.notes
        for data, name in zip(found.images, found.names, strict=True):
            kind = media_type(data)
            if kind not in ("image/png", "image/jpeg"):  # glTF takes no others
                kind = "image/png"
                try:
                    data = encoded_image(decode(data, name))
                except InputError as error:
                    warnings.append(str(error))
                    data = _WHITE_PNG
            images.append((data, kind))
    if images:  # a viewer multiplies colours and images; no other format means that
        colours = None
    normals = document.normals()
    has = {"materials": with_colours, "textures": images, "normals": normals is not None}
    carried = [name for name, there in has.items() if there]
    carried += [name for name in document.features if "colours" in name and colours is not None]
    label, materials = material_table(found, document)
    colours = None if colours is None else linear(colours)
    return Appearance(label, materials, images, uv, colours, normals, warnings, carried)


def material_table(found: Textures | None, document: Document) -> tuple[IntArray, list[Json]]:
    """(material of each face, materials). The groups of the document stay apart, and materials get their
    names."""
    groups, faces = document.mesh.groups, len(document.mesh.faces)
    group = np.zeros(faces, np.int64) if groups is None else groups
    image, colour = np.full(faces, -1), np.ones((faces, 4))
    rows = group[:, None]
    if found is not None:
        image = found.face
        colour[:, :3] = np.where(image[:, None] >= 0, 1.0, found.plain)
        colour[:, 3] = 1.0 if found.alpha is None else found.alpha
        rows = np.column_stack([group, image, colour])
    _, first, label = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    materials: list[Json] = []
    for k in first.tolist():
        name = document.group_name(group[k])
        pbr: Json = {"metallicFactor": 0.0, "roughnessFactor": 0.9}  # by default glTF has metal
        if image[k] >= 0:
            pbr["baseColorTexture"] = {"index": int(image[k])}
        if (colour[k] < 1).any():
            shown = np.round(linear(colour[k, :3]), 6).tolist()
            pbr["baseColorFactor"] = [*shown, float(colour[k, 3])]
        entry: Json = {"name": name} if name else {}
        entry["pbrMetallicRoughness"] = pbr
        if colour[k, 3] < 1:
            entry["alphaMode"] = "BLEND"
        materials.append(entry)
    return label.reshape(-1), materials


# a white texel: stands for an image that cannot be read
_WHITE_PNG = (
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\1\0\0\0\1\b\2\0\0\0\x90wS\xde\0\0\0\fIDATx\x9cc\xf8\xff\xff?"
    b"\0\5\xfe\2\xfe\r\xefF\xb8\0\0\0\0IEND\xaeB`\x82"
)
FAR_SIZES = 16  # sizes from the origin up to which float32 keeps a shape to a millionth of its size
LINES_NOTE = "seams, sharp edges and borders of colours"
OLD_SET = "its textures keep the old uv, as set 1: circparam bake --from texture carries them into the new set"
LARGEST_FLOAT32 = float(np.finfo(np.float32).max)


def to_gltf(
    document: Document,
    uvmap: UVMap | None,
    options: WriteOptions,
    stem: str = "",
    format: str = "gltf",
) -> Encoded:
    """glTF or GLB: input vertices first, duplicates behind, a primitive for each group, materials and colours.

    uvmap: None keeps the uv of the document. stem: names the file of the buffer; '' keeps it inside the JSON.
    """
    shown = appearance_of(document, options.colours)
    up = options.up or "y"
    points, at, changes = _placed(document.mesh, up)
    attributes = _attributes(document.mesh.faces, uvmap or shown.uv or document.uv(), shown, up)
    split = _split(document.mesh, attributes)
    notes, warnings = not_carried(document, format, *shown.carried)
    notes += changes
    if split.added:
        notes.append(duplicated(split.added, "seams" if len(attributes) == 1 else LINES_NOTE))
    warnings += shown.warnings
    if "TEXCOORD_1" in attributes:
        warnings.append(OLD_SET)
        for material in shown.materials:
            material["pbrMetallicRoughness"].get("baseColorTexture", {})["texCoord"] = 1
    edit = _bare_tree(document, shown.materials)
    grouping = exported_grouping(document, options.group_by)
    store_layout(edit.json, 0, grouping, options.pages)
    if at.any():
        edit.json["nodes"][0]["translation"] = at.tolist()
    named = {"POSITION": edit.array(points[split.source], bounds=True)}
    column = 0
    for name, (table, _) in attributes.items():
        rows = split.uv[:, column : column + table.shape[1]]
        named[name] = edit.array(_IN_FILE.get(name, np.asarray)(rows))
        column += table.shape[1]
    # a primitive for each material
    order = np.argsort(shown.label, kind="stable")
    faces = np.split(split.corner.reshape(-1, 3)[order], np.cumsum(np.bincount(shown.label))[:-1])
    edit.json["meshes"][0]["primitives"] = [
        {
            "attributes": dict(named),
            "indices": edit.indices(corner.ravel(), len(split.source)),
            "material": material,
        }
        for material, corner in enumerate(faces)
    ]
    for number, (data, kind) in enumerate(shown.images):
        image = {"bufferView": edit.view(data), "mimeType": kind}
        edit.json.setdefault("images", []).append(image)
        edit.json.setdefault("textures", []).append({"source": number, "sampler": 0})
        edit.json["samplers"] = [{"magFilter": 9729, "minFilter": 9987}]
    data, extra, _ = edit.finish(format, stem)
    return Encoded(data, format, split.source, order, extra, notes=notes, warnings=warnings)


def _bare_tree(document: Document, materials: list[Json]) -> Packing:
    """A tree of one node and one mesh, named as the file, without vertices."""
    name = document.path.stem if document.path is not None else "mesh"
    name = name.encode("utf-8", "replace").decode()  # names on a disk may be any bytes
    tree: Json = {
        "asset": {"version": "2.0", "generator": "circparam"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"name": name, "primitives": []}],
        "materials": materials,
        "accessors": [],
        "bufferViews": [],
    }
    return Packing(Tree(json.dumps(tree).encode(), Source("memory")))


def _placed(mesh: Mesh, up: str) -> tuple[npt.NDArray[np.float32], FloatArray, list[str]]:
    """((n, 3) points with y up as float32, (3,) place of their node, changes by storing).

    Raises OutputError for points beyond float32.
    """
    given = y_up(mesh.points, up)
    used = mask_of(len(given), mesh.faces.ravel())
    far = float(np.abs(given[used]).max())
    # the node has a place only where the mesh is so far away that rounding would spoil its shape
    low, high = given[used].min(0), given[used].max(0)
    with np.errstate(over="ignore", invalid="ignore"):
        near = not np.maximum(-low, high).max() > FAR_SIZES * (high - low).max()
        middle = np.zeros(3) if near else ((low + high) / 2).astype(np.float32).astype(np.float64)
    at = np.where(np.isfinite(middle), middle, 0.0)
    with np.errstate(over="ignore"):
        points = (np.nan_to_num(given, posinf=0.0, neginf=0.0) - at).astype(np.float32)
    if not far <= LARGEST_FLOAT32 or not np.isfinite(points).all():
        raise OutputError(
            f"positions up to {far:.3g} do not fit in float32, all that glTF stores: write OBJ or PLY, or "
            "scale the mesh"
        )
    rounded = (points.astype(np.float64) + at != given)[used].any()
    notes = {
        "turned from z up to y up, as glTF has it: --up y keeps the axes": up != "y",
        "positions were rounded to float32, all that glTF stores": rounded,
        "the mesh lies far from the origin: its node holds the place, its positions the shape": at.any(),
    }
    return points, at, [note for note, said in notes.items() if said]


# rows (k, w) of an attribute as stored, and the row of each corner (m, 3), −1 for zeros
_Attribute: TypeAlias = tuple[FloatArray, IntArray]
# how rows of these stand in the file
_IN_FILE: dict[str, Callable[[FloatArray], Any]] = {
    "TEXCOORD_0": file_uv, "TEXCOORD_1": file_uv, "NORMAL": unit_rows,
}  # fmt: skip


def _attributes(
    faces: IntArray, uvmap: UVMap | None, shown: Appearance, up: str
) -> dict[str, _Attribute]:
    """The uv, where there are any, and what else vertices have: old uv of images, normals, colours."""
    out: dict[str, _Attribute] = {}
    each = np.arange(faces.size).reshape(-1, 3)
    if uvmap is not None:
        out["TEXCOORD_0"] = stored_uv(uvmap.uv), uvmap.uv_faces
    if shown.uv is not None:
        old = stored_uv(shown.uv.uv), shown.uv.uv_faces
        if not np.array_equal(_of_corners(out["TEXCOORD_0"]), _of_corners(old)):
            out["TEXCOORD_1"] = old
    for name, rows in (
        ("NORMAL", None if shown.normals is None else y_up(shown.normals, up)),
        ("COLOR_0", shown.colours),
    ):
        if rows is not None:
            out[name] = rows.reshape(-1, 3).astype(np.float32).astype(np.float64), each
    return out


def _of_corners(attribute: _Attribute) -> FloatArray:
    """(3 m, w) the row of each corner."""
    rows, index = attribute
    return np.concatenate([rows, np.zeros((1, rows.shape[1]))])[index.ravel()]


def _split(mesh: Mesh, attributes: dict[str, _Attribute]) -> Split:
    """A vertex for each set of attributes that a vertex has."""
    n, vertex = len(mesh.points), mesh.faces.ravel()
    if len(attributes) == 1:
        ((rows, index),) = attributes.values()
        return split_vertices(n, vertex, rows, index.ravel())
    columns = [_of_corners(a) for a in attributes.values()] or [np.zeros((len(vertex), 1))]
    return split_vertices(n, vertex, np.concatenate(columns, axis=1), np.arange(len(vertex)))
