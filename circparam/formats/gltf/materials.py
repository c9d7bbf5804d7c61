"""The materials of a glTF tree: base colours as ``Textures``, all images as ``Looks``.

PLACES says where a material keeps its textures: the core of glTF 2.0, and the ratified extensions. Each row
gives the channels of the image and their factors (glTF 2.0, 3.9; KHR_materials_*).
"""

import base64
import binascii
import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.formats.gltf.reading import Json, Primitive, Tree, of_faces
from circparam.formats.looks import Looks, Material, Slot, Use, Wrap
from circparam.formats.materials import ImageFiles, Textures, srgb, tint, upwards

TRANSFORM, WEBP, VARIANTS = "KHR_texture_transform", "EXT_texture_webp", "KHR_materials_variants"
POINTER = "KHR_animation_pointer"
_WRAPS: dict[int, Wrap] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_NEAREST = 9728
RGB, RGBA, R, G, B, A = (0, 1, 2), (0, 1, 2, 3), (0,), (1,), (2,), (3,)


@dataclass(frozen=True)
class Place:
    """Where a slot stands in a material.

    holder: the path to the object with texture and factors. texture: its key. factors: keys of the numbers in
    the holder, of a ``scale`` or ``strength`` in the texture info itself (``inside``), with their defaults.
    """

    slot: Slot
    holder: tuple[str, ...]
    texture: str
    factors: tuple[tuple[str, tuple[float, ...]], ...] = ()
    inside: bool = False


def _place(holder: str, name: str, slot: Slot, *factors: tuple[str, tuple[float, ...]]) -> Place:
    path = ("extensions", holder) if "_" in holder else (holder,) if holder else ()
    return Place(slot, path, name, factors)


_PBR, _COAT = "pbrMetallicRoughness", "KHR_materials_clearcoat"
_SHEEN, _SPECULAR = "KHR_materials_sheen", "KHR_materials_specular"
_IRIDESCENCE, _ANISOTROPY = "KHR_materials_iridescence", "KHR_materials_anisotropy"
_TRANSMISSION, _VOLUME = "KHR_materials_transmission", "KHR_materials_volume"
_THROUGH, GLOSS = "KHR_materials_diffuse_transmission", "KHR_materials_pbrSpecularGlossiness"
_ONE, _NONE, _WHITE = (1.0,), (0.0,), (1.0, 1.0, 1.0)

PLACES = (
    _place(_PBR, "baseColorTexture", Slot("base colour", RGBA, "base_color", True, covers=True),
           ("baseColorFactor", (1.0, 1.0, 1.0, 1.0))),
    _place(_PBR, "metallicRoughnessTexture", Slot("metallic-roughness", (1, 2), "orm"),
           ("roughnessFactor", _ONE), ("metallicFactor", _ONE)),
    Place(Slot("normal", RGB, "normal", kind="normal"), (), "normalTexture", (("scale", _ONE),), True),
    Place(Slot("occlusion", R, "orm", kind="occlusion"), (), "occlusionTexture", (("strength", _ONE),), True),
    _place("", "emissiveTexture", Slot("emissive", RGB, "emissive", True), ("emissiveFactor", (0.0, 0.0, 0.0))),
    _place(_COAT, "clearcoatTexture", Slot("clearcoat", R, "clearcoat"), ("clearcoatFactor", _NONE)),
    _place(_COAT, "clearcoatRoughnessTexture", Slot("clearcoat roughness", G, "clearcoat"),
           ("clearcoatRoughnessFactor", _NONE)),
    Place(Slot("clearcoat normal", RGB, "clearcoat_normal", kind="normal"), ("extensions", _COAT),
          "clearcoatNormalTexture", (("scale", _ONE),), True),
    _place(_SHEEN, "sheenColorTexture", Slot("sheen colour", RGB, "sheen", True),
           ("sheenColorFactor", (0.0, 0.0, 0.0))),
    _place(_SHEEN, "sheenRoughnessTexture", Slot("sheen roughness", A, "sheen", True),
           ("sheenRoughnessFactor", _NONE)),
    _place(_SPECULAR, "specularTexture", Slot("specular", A, "specular", True), ("specularFactor", _ONE)),
    _place(_SPECULAR, "specularColorTexture", Slot("specular colour", RGB, "specular", True),
           ("specularColorFactor", _WHITE)),
    _place(_TRANSMISSION, "transmissionTexture", Slot("transmission", R, "transmission"),
           ("transmissionFactor", _NONE)),
    _place(_VOLUME, "thicknessTexture", Slot("thickness", G, "transmission"), ("thicknessFactor", _NONE)),
    _place(_IRIDESCENCE, "iridescenceTexture", Slot("iridescence", R, "iridescence"),
           ("iridescenceFactor", _NONE)),
    _place(_IRIDESCENCE, "iridescenceThicknessTexture",
           Slot("iridescence thickness", G, "iridescence", kind="range"),
           ("iridescenceThicknessMinimum", (100.0,)), ("iridescenceThicknessMaximum", (400.0,))),
    _place(_ANISOTROPY, "anisotropyTexture", Slot("anisotropy", RGB, "anisotropy", kind="direction"),
           ("anisotropyStrength", _NONE), ("anisotropyRotation", _NONE)),
    _place(_THROUGH, "diffuseTransmissionTexture", Slot("diffuse transmission", A, "through", True),
           ("diffuseTransmissionFactor", _NONE)),
    _place(_THROUGH, "diffuseTransmissionColorTexture",
           Slot("diffuse transmission colour", RGB, "through", True),
           ("diffuseTransmissionColorFactor", _WHITE)),
    _place(GLOSS, "diffuseTexture", Slot("diffuse", RGBA, "diffuse", True, covers=True),
           ("diffuseFactor", (1.0, 1.0, 1.0, 1.0))),
    _place(GLOSS, "specularGlossinessTexture", Slot("specular-glossiness", RGBA, "gloss", True),
           ("specularFactor", _WHITE), ("glossinessFactor", _ONE)),
)  # fmt: skip


def factors_of(holder: Json, place: Place) -> FloatArray:
    """The numbers of a slot, defaults where they are not given.

    Raises ValueError for too many or too few, and for one that is beyond float32, as JSON parsers read it.
    """
    origin = holder.get(place.texture) or {} if place.inside else holder
    out = []
    for key, default in place.factors:
        value = np.atleast_1d(np.asarray(origin.get(key, default), np.float64))
        if value.shape != (len(default),):
            raise ValueError(f"{key} has {value.size} numbers, {len(default)} are needed")
        if not (np.abs(value) <= np.finfo(np.float32).max).all():
            raise ValueError(f"{key} holds a number that no float32 is")
        out.append(value)
    return np.concatenate(out)


def set_factors(holder: Json, place: Place, values: FloatArray) -> None:
    """Write the numbers of a slot, in place; defaults are left out."""
    origin = holder[place.texture] if place.inside else holder
    at = 0
    for key, default in place.factors:
        mine = tuple(float(np.round(x, 9)) for x in values[at : at + len(default)])
        at += len(default)
        if mine == default:
            origin.pop(key, None)
        else:
            origin[key] = list(mine) if len(mine) > 1 else mine[0]


def places_of(material: Json) -> Iterator[tuple[Place, Json]]:
    """The slots that a material can have by its extensions, each with the object that holds it.

    The core's objects are always there.
    """
    for place in PLACES:
        holder: Any = material
        for key in place.holder:
            holder = None if holder is None else holder.get(key, {} if key == _PBR else None)
        if holder is not None:
            yield place, holder


def unlike(material: Json) -> str:
    """Properties of a material that no texel can hold, as text. Materials that differ in them stay apart."""
    rest: Json = json.loads(json.dumps(material))
    for place, holder in places_of(rest):
        holder.pop(place.texture, None)
        if not place.inside:
            for key, _ in place.factors:
                holder.pop(key, None)
    for key in ("name", "alphaCutoff", _PBR):
        if not (key == _PBR and rest.get(key)):
            rest.pop(key, None)
    return json.dumps(rest, sort_keys=True)


def textures(tree: Tree, primitives: list[Primitive]) -> Textures | None:
    """Base colour textures; factors without a texture as plain colours; None if all is white.

    Raises the errors of Python for a tree of the wrong shape.
    """
    files = _Images(tree)
    faces, plain, sets, tints = [], [], [], []
    for p in primitives:
        entry = p.entry(tree.json)
        material = tree.item("materials", entry["material"]) if "material" in entry else {}
        # Sketchfab's exports keep it in KHR_materials_pbrSpecularGlossiness, the last of PLACES
        place, holder = [x for x in places_of(material) if x[0].slot.covers][-1]
        texture = holder.get(place.texture)
        image = -1 if texture is None else files.of(tree.item("textures", texture["index"]))
        if texture is not None and image >= 0:
            image = files.moved(image, upwards(uv_transform(_moved(texture))))
            sets.append(uv_set_of(texture))
        ((key, white),) = place.factors
        factor = np.array(holder.get(key, white), float)
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
    return replace(found, tints=tuple(dict.fromkeys(filter(None, tints))))


def _moved(info: Json) -> Json:
    """How a texture info moves the uv."""
    return info.get("extensions", {}).get(TRANSFORM, {})


def uv_set_of(info: Json) -> int:
    """The uv set of a texture info, by its transform where that names one."""
    return int((info | _moved(info)).get("texCoord", 0))


def read_looks(tree: Tree, primitives: list[Primitive]) -> Looks:
    """The materials that triangles show.

    Raises InputError for a missing or empty image and for textures without a slot. Raises the errors of Python
    for a tree of the wrong shape.
    """
    entries = materials_of(tree.json)
    files = _Images(tree, strict=True)
    used = [material_number(tree.json, p, len(entries) - 1) for p in primitives]
    shown = set(used)
    materials = tuple(
        _material(tree, entry, files) if k in shown else Material("")
        for k, entry in enumerate(entries)
    )
    _check_carried(tree, primitives)
    face = of_faces(primitives, used)
    return Looks(tuple(files.images), tuple(files.names), materials, face)


def _check_carried(tree: Tree, primitives: list[Primitive]) -> None:
    """Raise InputError where an extension uses textures or changes materials, both of which are made anew."""
    keep = "keep the uv set with --lightmap, or"
    for p in primitives:
        extensions = p.entry(tree.json).get("extensions", {})
        if VARIANTS in extensions:
            raise tree.error(
                f"its faces show other materials by {VARIANTS}, whose textures would stay behind: "
                f"{keep} export one variant"
            )
        if using := [name for name, held in extensions.items() if any(texture_infos(held))]:
            raise tree.error(
                f"its faces use textures by {using[0]}, which would stay behind: "
                f"{keep} remove that extension"
            )
    channels = [c for a in tree.entries("animations") for c in a["channels"]]
    targets = [c["target"].get("extensions", {}).get(POINTER, {}) for c in channels]
    if any(str(target.get("pointer")).startswith("/materials/") for target in targets):
        raise tree.error(
            f"its animations change materials by {POINTER}, which name materials and textures of "
            f"the old uv: {keep} remove these channels"
        )


def materials_of(tree: Json) -> list[Json]:
    """The materials of a tree, and behind them the one of faces without any (glTF 2.0, 3.9.6)."""
    return [*tree.get("materials", []), {}]


def material_number(tree: Json, p: Primitive, default: int) -> int:
    """The material of a primitive, ``default`` if it names none. ValueError if it is not there."""
    number = p.entry(tree).get("material", default)
    if not isinstance(number, int) or not 0 <= number <= default:
        raise ValueError(f"a primitive names material {str(number)[:20]}")
    return number


def _material(tree: Tree, entry: Json, files: "_Images") -> Material:
    """One material with its images."""
    name = str(entry.get("name", ""))
    uses, factors, infos = {}, {}, []
    for place, holder in places_of(entry):
        info = holder.get(place.texture)
        if info is not None:
            texture = tree.item("textures", info["index"])
            sampler = tree.item("samplers", texture["sampler"]) if "sampler" in texture else {}
            wrap = tuple(_WRAPS[sampler.get(key, 10497)] for key in ("wrapS", "wrapT"))
            uses[place.slot] = Use(
                files.of(texture),
                uv_set_of(info),
                uv_transform(_moved(info)),
                (wrap[0], wrap[1]),
                nearest=sampler.get("magFilter") == _NEAREST,
            )
            infos.append(info)
        factors[place.slot] = factors_of(holder, place)
    other = [key for key, info in texture_infos(entry) if not any(info is i for i in infos)]
    if other:
        raise tree.error(
            f"material {name!r}: {other[0]} is a texture that is not known here and cannot be carried: "
            "remove it, or keep the uv set with --lightmap"
        )
    alpha, cutoff = str(entry.get("alphaMode", "OPAQUE")), float(entry.get("alphaCutoff", 0.5))
    return Material(name, uses, factors, alpha, cutoff, unlike(entry))


class _Images(ImageFiles):
    """The images of a tree, each read once."""

    def __init__(self, tree: Tree, strict: bool = False) -> None:
        super().__init__(tree.source, strict)
        self.tree = tree
        self.numbers: dict[int, int] = {}

    def of(self, texture: Json) -> int:
        """The number of the image of a texture, −1 (and a note) for one that cannot be had."""
        extensions = texture.get("extensions", {})
        held = [k for k, v in extensions.items() if isinstance(v, dict) and "source" in v]
        holder = texture if "source" in texture else extensions.get(WEBP, {})
        if "source" not in holder:
            if held or self.strict:
                how = f"is there by {held[0]} alone" if held else "has no image"
                self.missing(f"a texture {how}: export its image as PNG or JPEG")
            return -1
        number = int(holder["source"])
        if number not in self.numbers:
            self.numbers[number] = self._read(number)
        return self.numbers[number]

    def _read(self, number: int) -> int:
        """The number of an image here: from a buffer view, a data URI or a file beside the tree."""
        image = self.tree.item("images", number)
        name, uri = str(image.get("name") or f"image {number}"), str(image.get("uri", ""))
        if "bufferView" in image:
            return self.add(name, bytes(self.tree.view(image["bufferView"], name)[0]))
        if not uri.startswith("data:"):
            return self.read(uri)
        try:
            return self.add(name, base64.b64decode(uri.partition(",")[2]))
        except binascii.Error:
            self.missing(f"texture {name} holds malformed base64: export it again")
        return -1


def uv_transform(moved: Json) -> FloatArray:
    """(2, 3) the map of KHR_texture_transform: scale, then a turn that is counter-clockwise to the eye, then
    the offset; v points down.

    The example of the extension, the lower left quadrant turned by 90°, tells the direction.
    """
    turn = float(moved.get("rotation", 0.0))
    (sx, sy), (ox, oy) = moved.get("scale", (1.0, 1.0)), moved.get("offset", (0.0, 0.0))
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c * sx, s * sy, ox], [-s * sx, c * sy, oy]], np.float64)


def texture_infos(value: Any) -> Iterator[tuple[str, Json]]:
    """Every texture info in a material, with its key, those of extensions too."""
    if isinstance(value, dict):
        for key, entry in value.items():
            if isinstance(entry, dict) and "index" in entry and key != "extras":
                yield key, entry
            elif key != "extras":
                yield from texture_infos(entry)
    elif isinstance(value, list):
        for entry in value:
            yield from texture_infos(entry)
