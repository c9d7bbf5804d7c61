"""What the surface of a file looks like: its vertex colours and its textures, with where they lie.

Read from the documents that ``circparam.formats`` makes: OBJ with its material files, glTF materials, PLY
colours and TextureFile comments. Colours are sRGB, 0..1.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from PIL import Image

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.gltf.reading import safe_path
from circparam.formats.obj.document import ObjDocument
from circparam.formats.ply.document import PlyDocument
from circparam.mesh.mesh import UVMap

MEDIA_TYPES = {"PNG": "image/png", "JPEG": "image/jpeg", "WEBP": "image/webp", "GIF": "image/gif"}


@dataclass(frozen=True, eq=False)
class Textures:
    """The base colour textures of a file.

    images: each one's bytes as in its file. names: what to call them. face: (m,) int64, image of each face,
    −1 for none. plain: (m, 3) colour of the material of a face without image, white where there is none.
    uv_set: the set that the images refer to. notes: images that are missing or unreadable, one line each.
    """

    images: tuple[bytes, ...]
    names: tuple[str, ...]
    face: IntArray
    plain: FloatArray
    uv_set: int = 0
    notes: list[str] = field(default_factory=list)


def decode(data: bytes, name: str) -> Image.Image:
    """An image as RGB or RGBA. Raises InputError where it is broken, unknown, or absurdly large."""
    try:
        image = Image.open(io.BytesIO(data))
        image.load()
    except Image.DecompressionBombError as error:
        raise InputError(f"{name}: the texture is too large ({error}): scale it down") from None
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(f"{name}: the texture cannot be read ({error}): save it as PNG") from None
    has_alpha = "A" in image.getbands() or "transparency" in image.info
    return image.convert("RGBA" if has_alpha else "RGB")


def colours(document: Document) -> FloatArray | None:
    """(m, 3, 3) colour of every corner, from colours of vertices or faces; None where there are none."""
    faces = document.mesh.faces
    if isinstance(document, ObjDocument):
        scan = document.scan
        lines = scan.of(b"v")
        given = scan.last[lines] - scan.first[lines] - 1
        if not (given >= 6).any():
            return None
        values = scan.numbers(lines, 6, optional=3)[:, 3:]
        values[given < 6] = 1.0
        return _scaled(values)[faces]
    if isinstance(document, PlyDocument):
        return _ply_colours(document)
    if isinstance(document, GltfDocument):
        return _gltf_colours(document)
    return None


def _scaled(values: FloatArray) -> FloatArray:
    """0..255 as 0..1, where some value says that this is what is meant."""
    return np.clip(values / (255.0 if values.max(initial=0) > 1.0 else 1.0), 0, 1)


def _ply_colours(document: PlyDocument) -> FloatArray | None:
    names = ("red", "green", "blue")
    layout = document.layout
    vertex, face = layout.element("vertex"), layout.element("face")
    for element in (vertex, face):
        found = [element.find(name) for name in names] if element is not None else [None]
        if element is None or not all(found):
            continue
        values = layout.columns(element, names)
        codes = {p.type for p in found if p is not None}
        values = values / (255.0 if "u1" in codes else 65535.0 if "u2" in codes else 1.0)
        values = np.clip(values, 0, 1)
        if element is vertex:
            return values[document.mesh.faces]
        owner = document.polys.owner
        white = np.ones((max(int(owner.max(initial=-1)) + 1 - len(values), 0), 3))
        return np.repeat(np.concatenate([values, white])[owner][:, None], 3, axis=1)
    return None


def srgb(linear: FloatArray) -> FloatArray:
    """Linear light as sRGB (IEC 61966-2-1), both 0..1."""
    c = np.clip(linear, 0, 1)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


def _gltf_colours(document: GltfDocument) -> FloatArray | None:
    """COLOR_0, which glTF defines as linear light."""
    out = np.ones((len(document.mesh.points), 3))
    found = False
    for pool in document.pools:
        if "COLOR_0" in pool.attributes:
            values = document.tree.values(pool.attributes["COLOR_0"])
            out[pool.first : pool.first + pool.count] = srgb(values[:, :3])
            found = True
    return out[document.mesh.faces] if found else None


def textures(document: Document) -> Textures | None:
    """The textures of a file; None where no material names one. Raises InputError for a malformed material."""
    if isinstance(document, ObjDocument):
        return _obj_textures(document)
    if isinstance(document, GltfDocument):
        try:
            return _gltf_textures(document)
        except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
            raise document.source.error(
                f"a material is malformed ({type(error).__name__}: {error})"
            ) from None
    if isinstance(document, PlyDocument):
        return _ply_textures(document)
    return None


class _Files:
    """Image files beside a mesh, each read once; missing ones become notes."""

    def __init__(self, document: Document) -> None:
        self.folder = document.source.folder
        self.images: list[bytes] = []
        self.names: list[str] = []
        self.notes: list[str] = []
        self._known: dict[str, int] = {}

    def add(self, name: str, data: bytes) -> int:
        """The number of an image in memory."""
        self.images.append(data)
        self.names.append(name)
        return len(self.images) - 1

    def read(self, name: str) -> int:
        """The number of an image file, −1 (and a note) where it is missing."""
        name = re.sub(r"^(\./)+", "", name.replace("\\", "/"))
        if name not in self._known:
            self._known[name] = -1
            path = None if self.folder is None else safe_path(self.folder, name)
            try:
                if path is None:
                    raise FileNotFoundError
                self._known[name] = self.add(name, path.read_bytes())
            except OSError:
                self.notes.append(f"texture {name} is missing: put it beside the mesh")
        return self._known[name]


def _obj_textures(document: ObjDocument) -> Textures | None:
    files = _Files(document)
    materials: dict[str, tuple[int, FloatArray]] = {}
    for library in document.scan.libraries():
        path = None if files.folder is None else safe_path(files.folder, library)
        try:
            text = "" if path is None else path.read_text("utf-8", "replace")
        except OSError:
            files.notes.append(f"material file {library} is missing: put it beside the mesh")
            continue
        for name, colour, image in _mtl(text):
            materials[name] = (-1 if image is None else files.read(image), colour)
    lines, used = document.scan.lines(b"usemtl")
    if not materials and not files.notes:
        return None
    names = ["", *(name.decode("utf-8", "replace") for name in used)]
    none = (-1, np.ones(3))
    image_of = np.array([materials.get(name, none)[0] for name in names])
    plain: FloatArray = np.stack([materials.get(name, none)[1] for name in names])
    if not used and len(materials) == 1:  # a file that forgets usemtl, but has one material only
        image_of[0], plain[0] = next(iter(materials.values()))
    at = np.searchsorted(lines, document.scan.face_lines)[document.polys.owner]
    return Textures(
        tuple(files.images), tuple(files.names), image_of[at], plain[at], notes=files.notes
    )


def _mtl(text: str) -> Iterator[tuple[str, FloatArray, str | None]]:
    """(name, diffuse colour, image or None) of every material of an MTL file."""
    name: str | None = None
    colour: FloatArray = np.ones(3)
    image: str | None = None
    for line in text.splitlines():
        word, _, rest = line.strip().partition(" ")
        rest = rest.strip()
        if word == "newmtl":
            if name is not None:
                yield name, colour, image
            name, colour, image = rest, np.ones(3), None
        elif word == "Kd":
            numbers = re.findall(r"[-+.\deE]+", rest)[:3]
            try:
                colour = np.clip(np.array([float(x) for x in numbers]), 0, 1)
            except ValueError:
                colour = np.ones(3)
            colour = colour if colour.shape == (3,) else np.ones(3)
        elif word == "map_Kd":
            # options like "-s 1 1 1" stand before the name
            image = re.sub(r"^(-\w+(\s+(on|off|[-+.\d]+))*\s+)+", "", rest)
    if name is not None:
        yield name, colour, image


def _ply_textures(document: PlyDocument) -> Textures | None:
    """The first TextureFile comment, as MeshLab writes it."""
    files = _Files(document)
    m = len(document.mesh.faces)
    for line in document.layout.lines:
        comment = re.match(r"comment\s+TextureFile\s+(.+)", line.strip(), re.IGNORECASE)
        if comment:
            face = np.full(m, files.read(comment.group(1).strip()), np.int64)
            return Textures(
                tuple(files.images), tuple(files.names), face, np.ones((m, 3)), notes=files.notes
            )
    return None


def _gltf_textures(document: GltfDocument) -> Textures | None:
    """Base colour textures; factors without a texture as plain colours."""
    tree, files = document.tree, _Files(document)
    faces, plain = [], []
    known: dict[int, int] = {}
    sets: list[int] = []
    for p in document.primitives:
        entry = tree.json["meshes"][p.mesh]["primitives"][p.number]
        material = tree.item("materials", entry["material"]) if "material" in entry else {}
        pbr = material.get("pbrMetallicRoughness", {})
        texture = pbr.get("baseColorTexture")
        image = -1
        if texture is not None:
            source = _texture_source(tree.item("textures", texture["index"]))
            if source is not None:
                if source not in known:
                    known[source] = _gltf_image(document, files, source)
                image = known[source]
                sets.append(int(texture.get("texCoord", 0)))
        factor = srgb(np.array(pbr.get("baseColorFactor", [1.0, 1.0, 1.0, 1.0])[:3], float))
        faces.append(np.full(len(p.triangles), image))
        plain.append(np.tile(factor, (len(p.triangles), 1)))
    face = np.concatenate(faces).astype(np.int64)
    colour = np.concatenate(plain)
    if not files.images and not files.notes and np.allclose(colour, 1.0):
        return None
    uv_set = sets[0] if sets else 0
    if len(set(sets)) > 1:
        files.notes.append(f"textures refer to several uv sets: all are read with set {uv_set}")
    return Textures(
        tuple(files.images), tuple(files.names), face, colour, uv_set, notes=files.notes
    )


def _texture_source(texture: dict[str, Any]) -> int | None:
    """The image of a texture, WebP extension included."""
    for holder in (texture, texture.get("extensions", {}).get("EXT_texture_webp", {})):
        if "source" in holder:
            return int(holder["source"])
    return None


def _gltf_image(document: GltfDocument, files: _Files, number: int) -> int:
    image = document.tree.item("images", number)
    name = str(image.get("name") or f"image {number}")
    if "bufferView" in image:
        data, _ = document.tree.view(image["bufferView"], name)
        return files.add(name, bytes(data))
    uri = str(image.get("uri", ""))
    if uri.startswith("data:"):
        import base64
        import binascii

        try:
            return files.add(name, base64.b64decode(uri.partition(",")[2]))
        except binascii.Error:
            files.notes.append(f"texture {name} is malformed")
            return -1
    return files.read(uri)


def media_type(data: bytes) -> str | None:
    """The media type that a page can show an image's bytes as; None for a format that browsers lack."""
    try:
        kind = Image.open(io.BytesIO(data)).format or ""
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None
    return MEDIA_TYPES.get(kind)


def texture_layout(document: Document, textures: Textures) -> UVMap:
    """The uv that the textures refer to. Raises InputError where the file lacks that set."""
    uvmap = document.uv(textures.uv_set)
    if uvmap is None:
        raise InputError(
            f"{document.source.name}: its textures refer to uv set {textures.uv_set}, which it lacks: "
            "give the file that has it with --source"
        )
    return uvmap


__all__ = ["Textures", "colours", "decode", "media_type", "texture_layout", "textures"]
