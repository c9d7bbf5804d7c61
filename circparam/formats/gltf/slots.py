"""Where a glTF material keeps its textures: the core of glTF 2.0, and the ratified extensions.

Each row gives the channels of the image and their factors (glTF 2.0, 3.9; KHR_materials_*).
"""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.formats.gltf.reading import Json
from circparam.formats.looks import Slot

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
