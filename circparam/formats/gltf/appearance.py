"""Appearance of a new glTF tree: materials, images, colours and normals of any document."""

import io
from dataclasses import field

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, relabel
from circparam.core.records import dataclass
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.gltf.model import Json, media_type_of
from circparam.formats.materials import Textures, decode, linear
from circparam.mesh.mesh import UVMap


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
    images: list[tuple[bytes, str]] = field(default_factory=list)
    uv: UVMap | None = None
    colours: FloatArray | None = None
    normals: FloatArray | None = None
    warnings: list[str] = field(default_factory=list)
    carried: tuple[str, ...] = ()


def appearance_of(document: Document, with_colours: bool = True) -> Appearance:
    """The appearance of a document. with_colours: False leaves images and vertex colours out.

    A bad description in the document becomes a warning, because the mesh can still be written.
    """
    warnings: list[str] = []
    found = colours = None
    if with_colours:
        try:
            found = document.textures()
            colours = document.colours()
        except InputError as error:
            warnings.append(str(error))
    uv = None if found is None or not found.images else document.uv(found.uv_set)
    if found is not None and found.images and uv is None:
        warnings.append("its textures refer to uv that it lacks, and were left out")
        found = None
    label, materials, images, missing = material_table(found, len(document.mesh.faces), document)
    carried = ["materials"] if with_colours else []
    carried += ["textures"] if images else []
    if images:  # a viewer multiplies colours and images; no other format means that
        colours = None
    carried += [name for name in document.features if "colours" in name and colours is not None]
    normals = document.normals()
    carried += [] if normals is None else ["normals"]
    return Appearance(
        label, materials, images, uv, None if colours is None else linear(colours), normals,
        [*warnings, *missing], tuple(carried),
    )  # fmt: skip


def material_table(
    found: Textures | None, faces: int, document: Document | None = None
) -> tuple[IntArray, list[Json], list[tuple[bytes, str]], list[str]]:
    """(material of each face, materials, images with their media types, missing parts).

    document: whose groups stay apart, and whose names materials get.
    """
    groups = None if document is None else document.mesh.groups
    group = np.zeros(faces, np.int64) if groups is None else groups
    image, colour = np.full(faces, -1), np.ones((faces, 4))
    rows = group[:, None]
    if found is not None:
        image = found.face
        colour[:, :3] = np.where(image[:, None] >= 0, 1.0, found.plain)
        colour[:, 3] = 1.0 if found.alpha is None else found.alpha
        rows = np.column_stack([group, image, colour])
    _, first, label = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    label = label.reshape(-1)
    if document is None:  # in the order of the faces
        _, label = relabel(label)
        first = np.sort(first)
    given = () if document is None else document.group_names
    materials = []
    for k in first.tolist():
        shown = int(image[k]) if image[k] >= 0 else None
        name = given[group[k]] if group[k] < len(given) else ""
        if groups is not None and not name:
            name = f"group_{group[k]}"
        materials.append(({"name": name} if name else {}) | material(colour[k], shown))
    images, notes = _images(found)
    return label, materials, images, notes


def material(colour: FloatArray, image: int | None) -> Json:
    """A rough material that shows an image or a colour (sRGB, alpha); by default glTF has metal."""
    pbr: Json = {"metallicFactor": 0.0, "roughnessFactor": 0.9}
    if image is not None:
        pbr["baseColorTexture"] = {"index": image}
    if (colour < 1).any():
        pbr["baseColorFactor"] = [*np.round(linear(colour[:3]), 6).tolist(), float(colour[3])]
    return {"pbrMetallicRoughness": pbr} | ({"alphaMode": "BLEND"} if colour[3] < 1 else {})


def _images(found: Textures | None) -> tuple[list[tuple[bytes, str]], list[str]]:
    """Images as glTF takes them, with their media types, and unreadable ones."""
    if found is None:
        return [], []
    images, notes = [], list(found.notes)
    for data, name in zip(found.images, found.names, strict=True):
        try:
            images.append(_image(data, name))
        except InputError as error:
            notes.append(str(error))
            images.append((_white(), "image/png"))
    return images, notes


def _image(data: bytes, name: str) -> tuple[bytes, str]:
    """An image as glTF takes it: PNG and JPEG as they are, all others as PNG."""
    kind = media_type_of(data)
    if kind in ("image/png", "image/jpeg"):
        return data, kind
    out = io.BytesIO()
    decode(data, name).save(out, "PNG")
    return out.getvalue(), "image/png"


def _white() -> bytes:
    """A white texel: stands for an image that cannot be read."""
    from PIL import Image

    out = io.BytesIO()
    Image.new("RGB", (1, 1), "white").save(out, "PNG")
    return out.getvalue()
