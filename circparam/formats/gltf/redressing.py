"""A glTF tree whose materials show other images."""

import copy
import json
from collections.abc import Callable
from typing import TypeAlias

from circparam.formats.gltf.materials import (
    TRANSFORM,
    VARIANTS,
    material_number,
    materials_of,
    texture_infos,
)
from circparam.formats.gltf.model import Json, Primitive
from circparam.formats.gltf.slots import places_of, set_factors
from circparam.formats.gltf.unused import close_gaps
from circparam.formats.looks import Carried, Group


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
        entry = p.entry(out)
        group = first[material_number(tree, p, default)]
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
    # entries that lost their last user go; those that never had one stay
    final: dict[int, int] = {}
    for kind, users in _USERS.items():
        spare = set(range(len(tree.get(kind, [])))) - {int(c[key]) for c, key in users(tree)}
        entries, slots = out.setdefault(kind, []), users(out)
        used = {int(container[key]) for container, key in slots} | spare
        final = close_gaps(entries, set(range(len(entries))) - used, slots)
        if not entries:
            out.pop(kind)
    # extensions of textures that nothing uses any more leave the lists
    text = json.dumps({k: out.get(k) for k in ("materials", "textures")})
    for key in ("extensionsUsed", "extensionsRequired"):
        kinds = ("KHR_texture", "EXT_texture", "MSFT_texture")
        left = [n for n in out.get(key, []) if not n.startswith(kinds) or f'"{n}"' in text]
        if key in out:
            out[key] = left
            if not left:
                out.pop(key)
    images = {final[k]: page for k, page in images.items()}
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
