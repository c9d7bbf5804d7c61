"""Baked images on the disk: as PNG, one a tile, or inside a GLB whose materials show them."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from PIL import Image

from circparam.bake.bake import Across, Baked, Texels, bake_document
from circparam.bake.projection import own_frames
from circparam.core.files import check_free, write_files
from circparam.core.plural import counted, listed, plural
from circparam.errors import CircparamError, InputError, OptionError
from circparam.formats.document import FIRST_UDIM, Document, WriteOptions, turned, y_up
from circparam.formats.gltf.buffers import Packing
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.gltf.materials import GLOSS
from circparam.formats.gltf.morphing import with_frames
from circparam.formats.gltf.reading import Tree
from circparam.formats.io import encode
from circparam.formats.materials import encoded_image
from circparam.formats.source import Source
from circparam.formats.table import axis_up, up_of
from circparam.maps.surface_map import SurfaceMap
from circparam.pipeline.configure import open_source

# channels that --from texture carries, by their names in glTF, OBJ and PLY
ONE = ("base colour", "diffuse", "map_kd", "texture")
HOW = "carry all of them with circparam bake --all, or with circparam unwrap --rebake"


def check_target(path: Path, kind: str = "texture") -> None:
    """Raise OptionError if an output ends in neither .png nor .glb, or a GLB can't show the kind."""
    if path.suffix.lower() not in (".png", ".glb"):
        raise OptionError(f"{path}: bake into an image (.png) or a mesh with its image (.glb)")
    if kind == "height" and path.suffix.lower() == ".glb":
        raise OptionError(f"{path}: glTF has no place for heights: bake them into .png")


def check_up(path: Path, document: Document, up: str | None) -> None:
    """Raise OptionError for an axis that points up where no new glTF is written."""
    if up is None or (path.suffix.lower() == ".glb" and up_of(document.format) != "y"):
        return
    raise OptionError(
        f"--up has no effect here: {path} is not a new glTF made from another format; leave it out"
    )


def write_baked(
    path: Path, baked: Baked, document: Document, uv_set: int, kind: str, up: str | None = None
) -> tuple[list[Path], list[str]]:
    """Write a baked image: (files, notes).

    .png: one file, or NAME.1001.png and so on where the layout has several tiles. .glb: the document with the
    layout and the image inside, for a single unit square. With 'normals' their frames are stored as NORMAL and
    TANGENT. up: the axis that points up if a mesh becomes glTF; None: the axis of its format. Raises
    OptionError, OutputError.
    """
    check_target(path, kind)
    if path.suffix.lower() == ".png":
        # under the name given where there is one tile, else numbered as UDIM
        tiles = sorted(baked.tiles.items(), key=lambda item: item[0][::-1])
        numbers = [f".{FIRST_UDIM + u + 10 * v}" if len(tiles) > 1 else "" for (u, v), _ in tiles]
        images = {
            path.with_name(f"{path.stem}{number}{path.suffix}"): png(image)
            for number, (_, image) in zip(numbers, tiles, strict=True)
        }
        return write_files(images, overwrite=True), _tint_notes(baked)
    if list(baked.tiles) != [(0, 0)]:
        raise OptionError(
            f"{path}: a GLB holds one image, the layout has several tiles: bake into .png"
        )
    layout = document.require_uv(uv_set)
    is_gltf = document.format in ("gltf", "glb")
    number = uv_set if is_gltf else 0
    up = up or axis_up(document) or "y"
    options = WriteOptions(uv_set=number, overwrite_uv=True, colours=kind == "normals", up=up)
    encoded = encode(document, layout, "glb", options=options)
    notes = [note for note in encoded.notes if "was replaced" not in note]
    if kind != "normals":
        notes += _tint_notes(baked, document) + _gloss_notes(document)
    image, data = png(baked.tiles[0, 0]), encoded.data
    if kind == "normals":
        own = document.normals()
        if not is_gltf and up == "z":
            document, own = turned(document), None if own is None else y_up(own, up)
        space = own_frames(document, layout.corners, own)
        sign = np.broadcast_to(space.sign[:, None, None], (*space.normal.shape[:2], 1))
        tangent = np.concatenate([space.tangent, sign], 2)
        order = encoded.face_map
        data = with_frames(data, document.source, space.normal[order], tangent[order])
    data = embed(data, document.source, image, number, kind)
    return write_files({path: data}, overwrite=True), notes


def _tint_notes(baked: Baked, document: Document | None = None) -> list[str]:
    """Effects of materials on the colours that the output does not show; a glTF document keeps its own
    materials."""
    found = document.textures() if isinstance(document, GltfDocument) else None
    kept = () if found is None else found.tints
    return [f"{line}, which is not part of the image" for line in baked.tints if line not in kept]


def _gloss_notes(document: Document) -> list[str]:
    """Notes on materials that become metallic-roughness ones."""
    materials = (
        document.tree.json.get("materials", []) if isinstance(document, GltfDocument) else []
    )
    count = sum(GLOSS in m.get("extensions", {}) for m in materials)
    more = (
        "of specular-glossiness became metallic-roughness: alpha, tint and glossiness are kept, specular "
        "colours and images are not"
    )
    return [f"{counted(count, 'material')} {more}"] if count else []


def png(array: Texels, level: int = 7) -> bytes:
    """A tile as PNG bytes; level: of compression, 0 to 9."""
    image = Image.fromarray(array[..., 0] if array.shape[2] == 1 else array)
    return encoded_image(image, compress_level=level)


def embed(
    glb: bytes, source: Source, image: bytes, uv_set: int = 0, kind: str = "texture"
) -> bytes:
    """A GLB with a PNG in every material and on every face without one, as colour or normals by its kind.

    source: the file named in errors. uv_set: the set that the image refers to. Raises InputError if the
    bytes are no sound glTF.
    """
    edit = Packing(Tree(glb, source))
    new: dict[str, dict[str, Any]] = {
        "images": {"mimeType": "image/png", "name": "baked"},
        "samplers": {"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071},
        "textures": {},
    }
    place = {}
    for name, entry in new.items():
        place[name] = len(edit.json.setdefault(name, []))
        edit.json[name].append(entry)
    new["textures"] |= {"source": place["images"], "sampler": place["samplers"]}
    edit.images[place["images"]] = image
    _dress(edit.json, {"index": place["textures"], "texCoord": uv_set}, kind)
    return edit.finish("glb", "")[0]


def _dress(tree: dict[str, Any], texture: dict[str, int], kind: str) -> None:
    """Let every material of a tree show the texture, in place; primitives without a material get one."""
    materials = tree.setdefault("materials", [])
    for material in materials:
        if kind == "normals":
            material["normalTexture"] = dict(texture)
        else:
            _colour(material, texture)
    for names in ("extensionsUsed", "extensionsRequired"):
        if kind != "normals" and GLOSS in tree.get(names, []):
            tree[names].remove(GLOSS)
            if not tree[names]:  # an empty list is none that glTF knows
                tree.pop(names)
    primitives = [p for mesh in tree.get("meshes", []) for p in mesh["primitives"]]
    bare = [primitive for primitive in primitives if "material" not in primitive]
    for primitive in bare:
        primitive["material"] = len(materials)
    if bare:
        pbr: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
        plain = {"name": "baked", "pbrMetallicRoughness": pbr}
        if kind == "normals":
            pbr["roughnessFactor"] = 0.6
            plain["normalTexture"] = dict(texture)
        else:
            plain["pbrMetallicRoughness"] = {"baseColorTexture": dict(texture), **pbr}
        materials.append(plain)
    if kind == "vertex-colors":  # colours of vertices would tint the image
        for primitive in primitives:
            primitive["attributes"].pop("COLOR_0", None)


def _colour(material: dict[str, Any], texture: dict[str, int]) -> None:
    """Put the texture into the base colour of a material; its tint and its transparency stay."""
    pbr = material.setdefault("pbrMetallicRoughness", {})
    gloss = material.get("extensions", {}).pop(GLOSS, None)
    if material.get("extensions") == {}:
        material.pop("extensions")
    if gloss is not None:  # in the words of glTF 2.0: no metal, roughness for missing gloss
        if not {"metallicFactor", "metallicRoughnessTexture"} & pbr.keys():
            # the factor is only a part of the value where there is a texture
            rough = 1.0 - float(gloss.get("glossinessFactor", 1.0))
            pbr["metallicFactor"] = 0.0
            pbr["roughnessFactor"] = 0.9 if "specularGlossinessTexture" in gloss else rough
        for name in ("Factor", "Texture"):
            pbr.pop(f"baseColor{name}", None)
            if f"diffuse{name}" in gloss:
                pbr[f"baseColor{name}"] = gloss[f"diffuse{name}"]
    factor = pbr.pop("baseColorFactor", None)
    if factor is not None and "baseColorTexture" not in pbr:
        factor = [1.0, 1.0, 1.0, *factor[3:]]  # its colour is part of the image now
    if factor is not None and any(f != 1 for f in factor):
        pbr["baseColorFactor"] = factor
    pbr["baseColorTexture"] = dict(texture)


def bake_mesh(
    mesh: Any,
    kind: str,
    output: str | os.PathLike[str] | None = None,
    *,
    source: Any = None,
    overwrite: bool = False,
    across: Across | SurfaceMap | Literal["nearest"] | None = None,
    **keywords: Any,
) -> Baked:
    """Carry colours, a texture, normals or heights into the uv of a mesh.

    mesh: as for ``circparam.unwrap``, with uv. kind: texture, vertex-colors, normals or height. output: an
    image (.png) or the mesh with the image inside (.glb); None writes nothing. source: the mesh with the
    colours or the shape, None for the mesh itself. across: how places are found on it, or ``by`` alone.
    keywords: uv_set, size in texels, monitor, see ``bake_document``.

    Returns the images by tile and the notes on them. Raises OptionError, InputError, OutputError.
    """
    target = None if output is None else Path(output)
    if target is not None:
        check_target(target, kind)
        check_free(target, overwrite)
    if not isinstance(across, Across):
        across = Across(across)
    document = open_source(mesh)
    other = None if source is None else open_source(source)
    number = keywords.get("uv_set", 0)
    left = [] if target is None else check_left_behind(target, document, other, kind, number)
    baked = bake_document(document, kind, source=other, across=across, **keywords)
    if target is not None:
        write_baked(target, baked, document, number, kind)
    return replace(baked, notes=[*baked.notes, *left])


def check_left_behind(
    path: Path, document: Document, source: Document | None, kind: str, uv_set: int
) -> list[str]:
    """Notes on textures of the source that one image does not hold.

    Raises InputError if a GLB would show textures of the document in uv that they were not drawn for.
    """
    if kind != "texture":
        return []
    if path.suffix.lower() == ".glb" and source is not None:
        stale = _textures(document, uv_set)
        if stale:
            raise InputError(
                f"{document.source.name}: its {_named(stale)} would stay drawn for the uv before: {HOW}"
            )
    left = _textures(source or document, None)
    return [f"one image carries the base colour only, not {_named(left)}: {HOW}"] if left else []


def _textures(document: Document, uv_set: int | None) -> list[str]:
    """The slots, but for the base colour, in which faces of a document show an image; of one uv set, None for
    all."""
    try:
        looks = document.looks()
    except CircparamError:  # reading textures reports images that cannot be carried
        return []
    if looks is None:
        return []
    uses = [
        (slot.name, use)
        for k in np.unique(looks.face).tolist()
        for slot, use in looks.materials[k].uses.items()
    ]
    names = [name for name, use in uses if name not in ONE and uv_set in (None, use.uv_set)]
    return list(dict.fromkeys(names))


def _named(slots: list[str]) -> str:
    return f"{listed(slots, len(slots))} {plural(len(slots), 'texture')}"
