"""Put uv and images into a glTF tree: new accessors for changed data, everything else in place.

Primitives of one mesh that show the same material afterwards become one: fewer draw calls, the same vertices.
Their attributes, types, morph targets and extras have to be alike. Vertices that other primitives use too stay,
unless all joined primitives share them.
"""

import copy
import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.core.types import FloatArray, IntArray
from circparam.formats.gltf.buffers import Packing, Slots, close_gaps, lost_entries
from circparam.formats.gltf.materials import (
    TRANSFORM,
    VARIANTS,
    material_number,
    materials_of,
    places_of,
    set_factors,
    texture_infos,
    uv_set_of,
)
from circparam.formats.gltf.reading import COMPONENTS, TRIANGLES, Json, Pool, Primitive
from circparam.formats.gltf.scene import local_tangents, mesh_matrices
from circparam.formats.looks import Carried, Group
from circparam.formats.vertex_split import Split


def stored_uv(uv: FloatArray) -> FloatArray:
    """uv as glTF stores them: float32 u and float32 (1 − v), back as float64 with v upwards.

    For float64 v in [0, 1], 1 − v is a multiple of 2⁻⁵³ and stays one after rounding to float32. Turning v back
    is exact, so no second rounding can flip a triangle.
    """
    file = file_uv(uv).astype(np.float64)
    return np.stack([file[:, 0], 1.0 - file[:, 1]], 1)


def file_uv(uv: FloatArray) -> Any:
    """(k, 2) float32 as in the file, v downwards."""
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], 1).astype(np.float32) + np.float32(0)


class TreeEdit(Packing):
    """A copy of a tree in which vertices and uv of primitives change.

    new_tangents: (m, 3, 4) tangents to write, None if the old ones stay valid.
    """

    new_tangents: FloatArray | None = None
    # primitives (mesh, number) that keep the uv which are replaced, and the set in which
    keeps: frozenset[tuple[int, int]] = frozenset()
    kept_set: int = 0
    # primitives whose materials became one
    merged: Sequence[int] = ()

    def pool(
        self, users: list[Primitive], pool: Pool, split: Split, rows: npt.NDArray[Any], number: int
    ) -> int:
        """New attributes of one pool and the primitives that use it; returns the number of lost tangents."""
        entries = [p.entry(self.json) for p in users]
        attributes, targets = dict(pool.attributes), copy.deepcopy(pool.targets)
        last, name = number, f"TEXCOORD_{number}"
        if any((p.mesh, p.number) in self.keeps for p in users):
            last = self.kept_set
            if name in attributes:
                attributes[f"TEXCOORD_{last}"] = attributes[name]
        changed = {number, *(n for n in range(last) if f"TEXCOORD_{n}" not in attributes)}
        # tangents belong to the uv set of the normal map
        materials = materials_of(self.json)
        maps = [materials[e.get("material", -1)].get("normalTexture", {}) for e in entries]
        lost = "TANGENT" in attributes and any(uv_set_of(info) in changed for info in maps)
        if lost:
            for holder in (attributes, *targets):
                holder.pop("TANGENT", None)
        old = self.json["accessors"][attributes[name]] if name in attributes else {}
        new = self.array(rows, keep={k: v for k, v in old.items() if k in ("name", "extras")})
        for n in changed:
            attributes[f"TEXCOORD_{n}"] = new
            for target in targets:
                target.pop(f"TEXCOORD_{n}", None)
        if split.added:
            same: dict[int, int] = {new: new}
            for group in (attributes, *targets):
                for key, index in group.items():
                    if index not in same:
                        same[index] = self.extended(index, split.source)
                    group[key] = same[index]
        for entry in entries:
            order = [*entry["attributes"], *sorted(set(attributes) - set(entry["attributes"]))]
            entry["attributes"] = {key: attributes[key] for key in order if key in attributes}
            if "targets" in entry:
                entry["targets"] = copy.deepcopy(targets)
        return len(users) if lost else 0

    def dress(self, primitives: list[Primitive], carried: Carried) -> None:
        """Let the materials show carried images in place of theirs; the first edit of a tree.

        Materials that became one are one; textures, images and samplers without a user are gone.
        """
        old, new = self.tree.json, self.json
        known = materials_of(new)
        used = [(p, material_number(old, p, len(known) - 1)) for p in primitives]
        names = [name for p in primitives for name in p.entry(new)["attributes"]]
        sets = [int(name[9:]) for name in names if name[:9] == "TEXCOORD_"]
        self.kept_set = max([carried.uv_set, *sets]) + 1
        self.keeps = frozenset((p.mesh, p.number) for p, k in used if k in carried.kept)
        one = {k for group in carried.groups if len(group.members) > 1 for k in group.members}
        self.merged = [i for i, (_, k) in enumerate(used) if k in one]
        self.new_tangents, self.image_files = carried.tangents, carried.files or {}
        samplers, images, textures = (
            new.setdefault(kind, []) for kind in ("samplers", "images", "textures")
        )
        samplers.append({"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071})
        first_image, texture = len(images), {}
        for page in carried.pages:
            texture[page] = len(textures)
            textures.append({"sampler": len(samplers) - 1, "source": len(images)})
            images.append({"name": page, "mimeType": "image/png"})
        leads = {member: group for group in carried.groups for member in group.members}
        changed: dict[int, Json] = {}
        for p, k in used:
            lead = leads[k].members[0]
            if lead not in changed:
                changed[lead] = (
                    _moved_aside(known[lead], carried.uv_set, self.kept_set)
                    if lead in carried.kept
                    else _dressed(known[lead], leads[k], texture, carried.uv_set)
                )
            if changed[lead] != {}:
                p.entry(new)["material"] = lead
        new["materials"] = [changed.get(k, material) for k, material in enumerate(known)]
        number: dict[int, int] = {}  # of images, the last kind that loses its users
        for kind, users in _USERS.items():
            number = close_gaps(new[kind], lost_entries(old, new, kind, users), users(new))
            if not new[kind]:
                del new[kind]
        self.images = {
            number[first_image + i]: data for i, data in enumerate(carried.pages.values())
        }
        # extensions of textures that nothing uses any more leave the lists
        text = json.dumps({k: new.get(k) for k in ("materials", "textures")})
        for key in {"extensionsUsed", "extensionsRequired"} & new.keys():
            kinds = ("KHR_texture", "EXT_texture", "MSFT_texture")
            new[key] = [n for n in new[key] if not n.startswith(kinds) or f'"{n}"' in text]
            if not new[key]:
                del new[key]

    def tangents(self, users: list[Primitive], split: Split, new_tangents: FloatArray) -> None:
        """TANGENT of primitives with normals: those of corners (c, 4) in the world; the last of a vertex
        counts."""
        entries = [p.entry(self.json) for p in users]
        kept = any((p.mesh, p.number) in self.keeps for p in users)
        if kept or not all("NORMAL" in entry["attributes"] for entry in entries):
            return
        rows = np.tile([1.0, 0.0, 0.0, 1.0], (len(split.source), 1))
        rows[split.corner] = local_tangents(new_tangents, mesh_matrices(self.tree)[users[0].mesh])
        new = self.array(rows)
        for entry in entries:
            entry["attributes"]["TANGENT"] = new
            for target in entry.get("targets", []):
                target.pop("TANGENT", None)

    def extended(self, index: int, source: IntArray) -> int:
        """An accessor with its rows in a new order, raw. Sparse values stand in the rows, and not twice."""
        entry = {
            k: v
            for k, v in self.json["accessors"][index].items()
            if k not in ("bufferView", "byteOffset", "sparse", "count")
        }
        return self.accessor(entry, self.tree.rows(index)[source])

    def relist(self, users: list[Primitive], split: Split) -> int:
        """New index lists of primitives; returns the number of former strips and fans."""
        at = relisted = 0
        for p in users:
            entry = p.entry(self.json)
            n = p.triangles.size
            corner = split.corner[at : at + n]
            if p.turned:
                corner = corner.reshape(-1, 3)[:, ::-1].ravel()
            at += n
            old = self.json["accessors"][entry["indices"]] if "indices" in entry else {}
            keep = {k: v for k, v in old.items() if k in ("name", "extras")}
            if "min" in old or "max" in old:
                keep |= {"max": [int(corner.max())], "min": [int(corner.min())]}
            least = old.get("componentType", 5123)
            entry["indices"] = self.indices(corner, len(split.source), least, keep)
            if entry.get("mode", TRIANGLES) != TRIANGLES:
                entry["mode"] = TRIANGLES
                relisted += 1
        return relisted


def join_primitives(
    edit: Packing, primitives: Sequence[Primitive], chosen: Iterable[int]
) -> list[list[int]]:
    """Join those of the chosen primitives that can be, in place.

    primitives: all of the tree, in the order of the faces. Returns the sources of each primitive of the new
    tree, in order: numbers of ``primitives``.
    """
    alone = [[i] for i in range(len(primitives))]
    if edit.careful:
        return alone
    alike: dict[str, list[int]] = defaultdict(list)
    for i in chosen:
        entry = primitives[i].entry(edit.json)
        if entry.get("mode", TRIANGLES) == TRIANGLES and "extensions" not in entry:
            alike[_kind(edit, primitives[i].mesh, entry)].append(i)
    users: dict[int, set[int]] = defaultdict(set)
    for i, p in enumerate(primitives):
        users[p.pool].add(i)
    blocks = {}
    for group in alike.values():
        pools = {primitives[i].pool for i in group}
        if len(pools) > 1:
            group = [i for i in group if users[primitives[i].pool] <= set(group)]
        if len(group) > 1:
            _join(edit, [primitives[i] for i in group])
            blocks[group[0]] = group
    gone = {i for group in blocks.values() for i in group[1:]}
    dropped = {id(primitives[i].entry(edit.json)) for i in gone}
    for mesh in edit.json["meshes"]:
        mesh["primitives"] = [e for e in mesh["primitives"] if id(e) not in dropped]
    return [blocks.get(i, [i]) for i in range(len(primitives)) if i not in gone]


def _kind(edit: Packing, mesh: int, entry: Json) -> str:
    """Common properties of primitives that can be joined, as text."""

    def types(attributes: dict[str, int]) -> list[Any]:
        known = edit.json["accessors"]
        keys = ("componentType", "type", "normalized")
        return [
            [name, *(known[k].get(key) for key in keys)] for name, k in sorted(attributes.items())
        ]

    rest = {k: v for k, v in entry.items() if k not in ("attributes", "targets", "indices", "mode")}
    targets = [types(target) for target in entry.get("targets", [])]
    return json.dumps([mesh, types(entry["attributes"]), targets, rest], sort_keys=True)


def _join(edit: Packing, group: list[Primitive]) -> None:
    """Let the first of some primitives have the vertices and triangles of all, in place."""
    entries = [p.entry(edit.json) for p in group]
    first_of = {p.pool: entry for p, entry in zip(group[::-1], entries[::-1], strict=True)}
    pools = sorted(first_of)  # in the order in which they are read
    size = [edit.json["accessors"][first_of[k]["attributes"]["POSITION"]]["count"] for k in pools]
    start = dict(zip(pools, np.cumsum([0, *size]).tolist(), strict=False))
    index = [_index(edit, entry, start[p.pool]) for p, entry in zip(group, entries, strict=True)]
    head = entries[0]
    if len(pools) > 1:
        holders = [[first_of[k]["attributes"], *first_of[k].get("targets", [])] for k in pools]
        made: dict[tuple[int, ...], int] = {}
        joined = []
        for same in zip(*holders, strict=True):
            out = {}
            for name in same[0]:
                numbers = tuple(one[name] for one in same)
                if numbers not in made:
                    made[numbers] = _concatenated(edit, numbers)
                out[name] = made[numbers]
            joined.append(out)
        head["attributes"] = joined[0]
        if "targets" in head:
            head["targets"] = joined[1:]
    lists = [entry["indices"] for entry in entries if "indices" in entry]
    least = max((edit.json["accessors"][k]["componentType"] for k in lists), default=5123)
    head["indices"] = edit.indices(np.concatenate(index), sum(size), least)


def _index(edit: Packing, entry: Json, start: int) -> Any:
    """(c,) the vertices of a primitive, counted from ``start``."""
    if "indices" not in entry:
        count = edit.json["accessors"][entry["attributes"]["POSITION"]]["count"]
        return np.arange(count - count % 3) + start
    accessor = edit.json["accessors"][entry["indices"]]
    kind = COMPONENTS[accessor["componentType"]]
    index = np.ascontiguousarray(edit.rows(entry["indices"])).view(kind)[:, 0].astype(np.int64)
    return index[: len(index) - len(index) % 3] + start


def _concatenated(edit: Packing, numbers: tuple[int, ...]) -> int:
    """A new accessor with the rows of several, one after the other."""
    entries = [edit.json["accessors"][k] for k in numbers]
    keys = ("componentType", "type", "normalized")
    entry = {key: entries[0][key] for key in keys if key in entries[0]}
    for key, best in (("min", np.min), ("max", np.max)):
        if all(key in e for e in entries):
            entry[key] = best([e[key] for e in entries], axis=0).tolist()
    return edit.accessor(entry, np.concatenate([edit.rows(k) for k in numbers]))


def _moved_aside(material: Json, uv_set: int, kept_set: int) -> Json:
    """A material that keeps its textures, those of a uv set in another one."""
    out = copy.deepcopy(material)
    for _, info in texture_infos(out):
        if uv_set_of(info) == uv_set:
            transform = info.get("extensions", {}).get(TRANSFORM, {})
            (transform if "texCoord" in transform else info)["texCoord"] = kept_set
    return out


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
