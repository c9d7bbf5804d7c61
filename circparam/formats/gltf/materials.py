"""Colours and textures of a glTF tree: COLOR_0, and base colour of its materials."""

import base64
import binascii
from dataclasses import replace
from typing import Any

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.formats.gltf.looks import TRANSFORM, texture_infos, uv_transform
from circparam.formats.gltf.model import Pool, Primitive
from circparam.formats.gltf.reading import Tree
from circparam.formats.materials import ImageFiles, Textures, srgb, tint


def colours(tree: Tree, pools: list[Pool], faces: IntArray) -> FloatArray | None:
    """(m, 3, 3) COLOR_0 of every corner, which glTF defines as linear light; None if there is none."""
    out = np.ones((sum(pool.count for pool in pools), 3))
    found = False
    for pool in pools:
        if "COLOR_0" in pool.attributes:
            values = tree.values(pool.attributes["COLOR_0"])
            out[pool.part] = srgb(values[:, :3])
            found = True
    return out[faces] if found else None


def textures(tree: Tree, primitives: list[Primitive]) -> Textures | None:
    """Base colour textures; factors without a texture as plain colours; None if all is white.

    Raises the errors of Python for a tree of the wrong shape.
    """
    files = ImageFiles(tree.source)
    faces, plain = [], []
    known: dict[tuple[int, bytes], int] = {}
    moves: dict[int, FloatArray] = {}
    sets: list[int] = []
    tints: list[str] = []
    for p in primitives:
        entry = tree.json["meshes"][p.mesh]["primitives"][p.number]
        material = tree.item("materials", entry["material"]) if "material" in entry else {}
        pbr = _base_colour(material)
        texture = pbr.get("baseColorTexture")
        image = -1
        if texture is not None:
            shown = tree.item("textures", texture["index"])
            source, moved = _texture_source(shown), _moved(texture)
            if source is None:
                note = _unread(shown)
                files.notes += [note] if note and note not in files.notes else []
            else:
                move = affine(moved)
                key = source, move.tobytes()
                if key not in known:
                    known[key] = image = _image(tree, files, source)
                    # parts with further instances
                    if not np.array_equal(moves.get(image, move), move):
                        known[key] = files.add(files.names[image], files.images[image])
                    moves[known[key]] = move
                image = known[key]
                sets.append(int(moved.get("texCoord", texture.get("texCoord", 0))))
        factor = np.array(pbr.get("baseColorFactor", [1.0, 1.0, 1.0, 1.0]), float)
        tints.append(tint(str(material.get("name", entry.get("material"))), factor, image >= 0))
        faces.append(np.full(len(p.triangles), image))
        plain.append(np.tile(srgb(factor[:3]), (len(p.triangles), 1)))
    colour = np.concatenate(plain)
    if not files.images and not files.notes and np.allclose(colour, 1.0):
        return None
    uv_set = sets[0] if sets else 0
    if len(set(sets)) > 1:
        files.notes.append(f"textures refer to several uv sets: all are read with set {uv_set}")
    found = files.textures(np.concatenate(faces).astype(np.int64), colour, uv_set)
    found = replace(found, tints=tuple(dict.fromkeys(filter(None, tints))))
    if all(np.array_equal(move, np.eye(2, 3)) for move in moves.values()):
        return found
    return replace(found, moves=tuple(moves[k] for k in range(len(found.images))))


def affine(moved: dict[str, Any]) -> FloatArray:
    """(2, 3) the effect of KHR_texture_transform on uv with v upwards: scaled, turned, then shifted.

    The example of the extension, the lower left quadrant turned by 90°, tells the direction.
    """
    down = uv_transform(moved)
    shift = [down[0, 2] + down[0, 1], 1 - down[1, 2] - down[1, 1]]  # both sides with v upwards
    return np.column_stack([down[:, :2] * [[1, -1], [-1, 1]], shift]) + 0.0


def _base_colour(material: dict[str, Any]) -> dict[str, Any]:
    """Texture and factor of a material's base colour, by today's names.

    Older exports, Sketchfab's among them, keep both in KHR_materials_pbrSpecularGlossiness, which comes first
    where a reader knows it.
    """
    gloss = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
    if gloss is None:
        found: dict[str, Any] = material.get("pbrMetallicRoughness", {})
        return found
    names = {"diffuseTexture": "baseColorTexture", "diffuseFactor": "baseColorFactor"}
    return {names[key]: value for key, value in gloss.items() if key in names}


def texture_sets(entries: Any) -> set[int]:
    """The uv sets that texture infos anywhere in a tree refer to."""
    infos = (info for key, info in texture_infos(entries) if key.endswith("Texture"))
    return {int((info | _moved(info)).get("texCoord", 0)) for info in infos}


def _texture_source(texture: dict[str, Any]) -> int | None:
    """The image of a texture, WebP extension included."""
    for holder in (texture, texture.get("extensions", {}).get("EXT_texture_webp", {})):
        if "source" in holder:
            return int(holder["source"])
    return None


def _unread(texture: dict[str, Any]) -> str:
    """A note on a texture whose image only an extension knows; empty for other textures."""
    named = texture.get("extensions", {})
    known = [str(n) for n, held in named.items() if isinstance(held, dict) and "source" in held]
    return (
        f"a texture is compressed ({known[0]}): it is not read, export PNG or JPEG" if known else ""
    )


def _moved(info: dict[str, Any]) -> dict[str, Any]:
    """How a texture info moves the uv."""
    found: dict[str, Any] = info.get("extensions", {}).get(TRANSFORM, {})
    return found


def _image(tree: Tree, files: ImageFiles, number: int) -> int:
    """The number in ``files`` of an image of the tree: from a buffer view, a data URI or a file."""
    image = tree.item("images", number)
    name = str(image.get("name") or f"image {number}")
    if "bufferView" in image:
        data, _ = tree.view(image["bufferView"], name)
        return files.add(name, bytes(data))
    uri = str(image.get("uri", ""))
    if uri.startswith("data:"):
        try:
            return files.add(name, base64.b64decode(uri.partition(",")[2]))
        except binascii.Error:
            files.notes.append(f"texture {name} is malformed")
            return -1
    return files.read(uri)
