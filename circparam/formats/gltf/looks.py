"""The materials of a glTF tree as ``Looks``, and a tree whose materials show other images."""

import base64
import binascii
import copy
import json
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.formats.gltf.model import Json, Primitive
from circparam.formats.gltf.reading import Tree
from circparam.formats.gltf.slots import factors_of, places_of, set_factors, texture_info, unlike
from circparam.formats.looks import Carried, Group, Looks, Material, Use, Wrap
from circparam.formats.source import found_beside, regular_bytes

TRANSFORM, WEBP, VARIANTS = "KHR_texture_transform", "EXT_texture_webp", "KHR_materials_variants"
_WRAPS: dict[int, Wrap] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_NEAREST = 9728


def read_looks(tree: Tree, primitives: list[Primitive]) -> Looks:
    """The materials that triangles show.

    Raises InputError for a missing or empty image and for textures without a slot. Raises the errors of Python
    for a tree of the wrong shape.
    """
    entries = materials_of(tree.json)
    reader = _Images(tree)
    used = [_material_of(tree.json, p, len(entries) - 1) for p in primitives]
    shown = set(used)
    materials = tuple(
        reader.material(entry) if k in shown else Material("") for k, entry in enumerate(entries)
    )
    for p in primitives:
        entry = tree.json["meshes"][p.mesh]["primitives"][p.number]
        if VARIANTS in entry.get("extensions", {}):
            raise tree.error(
                f"its faces show other materials by {VARIANTS}, whose textures would stay behind: keep the uv "
                "set with --lightmap, or export one variant"
            )
    face = np.repeat(np.array(used, np.int64), [len(p.triangles) for p in primitives])
    return Looks(tuple(reader.images), tuple(reader.names), materials, face)


def materials_of(tree: Json) -> list[Json]:
    """The materials of a tree, and behind them the one of faces without any (glTF 2.0, 3.9.6)."""
    return [*tree.get("materials", []), {}]


def _material_of(tree: Json, p: Primitive, default: int) -> int:
    number = tree["meshes"][p.mesh]["primitives"][p.number].get("material", default)
    if not isinstance(number, int) or not 0 <= number <= default:
        raise ValueError(f"a primitive names material {str(number)[:20]}")
    return number


class _Images:
    """The images of a tree, each read once."""

    def __init__(self, tree: Tree) -> None:
        self.tree = tree
        self.images: list[bytes] = []
        self.names: list[str] = []
        self._known: dict[int, int] = {}

    def material(self, entry: Json) -> Material:
        """One material with its images."""
        name = str(entry.get("name", ""))
        uses, factors, infos = {}, {}, []
        for place, holder in places_of(entry):
            info = texture_info(holder, place)
            if info is not None:
                uses[place.slot] = self.use(info)
                infos.append(info)
            factors[place.slot] = factors_of(holder, place)
        other = [key for key, info in texture_infos(entry) if not any(info is i for i in infos)]
        if other:
            raise self.tree.error(
                f"material {name!r}: {other[0]} is a texture that is not known here and cannot be carried: "
                "remove it, or keep the uv set with --lightmap"
            )
        alpha, cutoff = str(entry.get("alphaMode", "OPAQUE")), float(entry.get("alphaCutoff", 0.5))
        return Material(name, uses, factors, alpha, cutoff, unlike(entry))

    def use(self, info: Json) -> Use:
        """How a texture info shows its image."""
        texture = self.tree.item("textures", info["index"])
        sampler = self.tree.item("samplers", texture["sampler"]) if "sampler" in texture else {}
        moved = info.get("extensions", {}).get(TRANSFORM, {})
        wrap = tuple(_WRAPS[sampler.get(key, 10497)] for key in ("wrapS", "wrapT"))
        return Use(
            self.image(texture),
            int(moved.get("texCoord", info.get("texCoord", 0))),
            uv_transform(moved),
            (wrap[0], wrap[1]),
            sampler.get("magFilter") == _NEAREST,
        )

    def image(self, texture: Json) -> int:
        """The number of the image of a texture, in a format that can be decoded."""
        webp = texture.get("extensions", {}).get(WEBP, {})
        number = webp.get("source", texture.get("source"))
        if number is None:
            held = [k for k, v in texture.get("extensions", {}).items() if "source" in v]
            how = f"is there by {held[0]} alone" if held else "has no image"
            raise self.tree.error(f"a texture {how}: export its image as PNG or JPEG")
        if number not in self._known:
            name, data = self.content(number)
            self._known[number] = len(self.images)
            self.images.append(data)
            self.names.append(name)
        return self._known[number]

    def content(self, number: int) -> tuple[str, bytes]:
        """(name, bytes) of an image: from a buffer view, a data URI or a file beside the tree."""
        image = self.tree.item("images", number)
        name = str(image.get("name") or image.get("uri", "")[:80] or f"image {number}")
        if "bufferView" in image:
            return name, bytes(self.tree.view(image["bufferView"], name)[0])
        uri = str(image.get("uri", ""))
        if uri.startswith("data:"):
            try:
                return f"image {number}", base64.b64decode(uri.partition(",")[2])
            except binascii.Error:
                raise self.tree.error(f"image {number} holds malformed base64") from None
        path = found_beside(self.tree.source.folder, uri)
        try:
            if path is None:
                raise FileNotFoundError(2, "No such file or directory")
            return uri, regular_bytes(path)
        except OSError as error:
            raise self.tree.error(
                f"the texture {uri} cannot be read ({error.strerror}): put it beside the file"
            ) from None


def uv_transform(moved: Json) -> FloatArray:
    """(2, 3) the map of KHR_texture_transform: scale, then a turn that is counter-clockwise to the eye, then
    the offset; v points down."""
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


def redressed(
    tree: Json, primitives: list[Primitive], carried: Carried, kept_set: int = 0
) -> tuple[Json, dict[int, str]]:
    """A copy of a tree whose triangles show carried images: (tree, page of each of its new images).

    Materials that became one are one; textures, images and samplers without a user are gone.
    """
    out = copy.deepcopy(tree)
    known = materials_of(out)
    default = len(known) - 1
    out["samplers"] = [
        *out.get("samplers", []),
        {"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071},
    ]
    images, number = {}, {}
    for page in carried.pages:
        images[len(out.setdefault("images", []))] = page
        out["images"].append({"name": page, "mimeType": "image/png"})
        number[page] = len(out.setdefault("textures", []))
        out["textures"].append(
            {"sampler": len(out["samplers"]) - 1, "source": len(out["images"]) - 1}
        )
    first = {member: group for group in carried.groups for member in group.members}
    changed = {}
    for p in primitives:
        entry = out["meshes"][p.mesh]["primitives"][p.number]
        group = first[_material_of(tree, p, default)]
        lead = group.members[0]
        if lead not in changed:
            changed[lead] = _dressed(known[lead], group, number, carried.uv_set)
            if lead in carried.kept:
                changed[lead] = in_set(known[lead], carried.uv_set, kept_set)
        if changed[lead] != {}:
            entry["material"] = lead
    for k, material in changed.items():
        known[k] = material
    out["materials"] = known
    images = _compact(out, images, tree)
    return out, images


def _dressed(material: Json, group: Group, texture: dict[str, int], uv_set: int) -> Json:
    """A material that shows the carried images, with the factors that go with them."""
    out = copy.deepcopy(material)
    for place, found in places_of(out):
        holder = found
        if place.slot not in group.factors:
            continue
        if place.slot in group.shown:
            if place.holder == ("pbrMetallicRoughness",):
                holder = out.setdefault("pbrMetallicRoughness", {})
            old = holder.get(place.texture, {})
            kept = {k: v for k, v in old.items() if k in ("extras", "scale", "strength")}
            info = {"index": texture[place.slot.page], "texCoord": uv_set, **kept}
            holder[place.texture] = {k: v for k, v in info.items() if (k, v) != ("texCoord", 0)}
            set_factors(holder, place, group.factors[place.slot])
    if out.get("alphaMode") == "MASK" and group.cutoff != out.get("alphaCutoff", 0.5):
        out["alphaCutoff"] = group.cutoff
    return out


def in_set(material: Json, old: int, new: int) -> Json:
    """A material whose textures refer to one uv set in place of another."""
    out = copy.deepcopy(material)
    for _, info in texture_infos(out):
        holder = info.get("extensions", {}).get(TRANSFORM, {})
        holder = holder if "texCoord" in holder else info
        if holder.get("texCoord", 0) == old:
            holder["texCoord"] = new
    return out


def _compact(tree: Json, images: dict[int, str], before: Json) -> dict[int, str]:
    """Take out materials, textures, samplers and images that lost their last user, in place.

    images: numbers of the new ones; returned with their final numbers. before: the original tree, whose unused
    entries stay.
    """
    moves: dict[int, int] = {}
    for kind, users in _USERS.items():
        count = len(before.get(kind, []))
        spare = set(range(count)) - {int(c[key]) for c, key in users(before)}
        slots = users(tree)
        used = sorted({int(container[key]) for container, key in slots} | spare)
        moves = {k: i for i, k in enumerate(used)}
        for container, key in slots:
            container[key] = moves[container[key]]
        tree[kind] = [tree.get(kind, [])[k] for k in used]
        if not tree[kind]:
            tree.pop(kind)
    _drop_extensions(tree)
    return {moves[k]: page for k, page in images.items()}


Slots: TypeAlias = list[tuple[Json, str]]


def _material_users(tree: Json) -> Slots:
    users = [p for mesh in tree["meshes"] for p in mesh["primitives"]]
    mapped = [
        m for p in users for m in p.get("extensions", {}).get(VARIANTS, {}).get("mappings", [])
    ]
    return [(x, "material") for x in (*users, *mapped) if "material" in x]


def _image_users(tree: Json) -> Slots:
    holders = [h for t in tree.get("textures", []) for h in (t, *t.get("extensions", {}).values())]
    return [(h, "source") for h in holders if "source" in h]


# in the order in which they lose their users
_USERS: dict[str, Callable[[Json], Slots]] = {
    "materials": _material_users,
    "textures": lambda tree: [(i, "index") for _, i in texture_infos(tree.get("materials", []))],
    "samplers": lambda tree: [(t, "sampler") for t in tree.get("textures", []) if "sampler" in t],
    "images": _image_users,
}


def _drop_extensions(tree: Json) -> None:
    """Take extensions of textures that nothing uses any more off the lists, in place."""
    text = json.dumps({k: tree.get(k) for k in ("materials", "textures")})
    for key in ("extensionsUsed", "extensionsRequired"):
        kinds = ("KHR_texture", "EXT_texture", "MSFT_texture")
        left = [n for n in tree.get(key, []) if not n.startswith(kinds) or f'"{n}"' in text]
        if key in tree:
            tree[key] = left
            if not left:
                tree.pop(key)
