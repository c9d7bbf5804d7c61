"""Put uv into a glTF tree: new accessors for changed data, everything else in place."""

import copy
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.core.plural import counted
from circparam.core.types import FloatArray, IntArray
from circparam.formats.document import Encoded
from circparam.formats.gltf.buffers import Packing
from circparam.formats.gltf.joining import join_primitives
from circparam.formats.gltf.model import TRIANGLES, Json, Pool, Primitive
from circparam.formats.gltf.redressing import redressed
from circparam.formats.gltf.scene import mesh_matrices, times, unit_rows
from circparam.formats.looks import Carried
from circparam.formats.vertex_split import Split, duplicated, split_vertices
from circparam.mesh.mesh import UVMap


def write_uv(
    edit: "TreeEdit", primitives: list[Primitive], pools: list[Pool], uvmap: UVMap, number: int, *,
    format: str, stem: str,
) -> Encoded:  # fmt: skip
    """The tree of an edit with TEXCOORD_number of all its triangles; see ``GltfDocument.rewrite``."""
    stored = stored_uv(uvmap.uv)
    start = np.cumsum([0, *(len(p.triangles) for p in primitives)])
    sources, added, listed, dropped = [], 0, 0, 0
    users_of = defaultdict(list)
    for i, p in enumerate(primitives):
        users_of[p.pool].append(i)
    for k, pool in enumerate(pools):
        mine = users_of[k]
        if not mine:  # all its primitives are empty
            sources.append(pool.first + np.arange(pool.count))
            continue
        corners = np.concatenate([primitives[i].triangles.ravel() for i in mine])
        uv_of = np.concatenate([uvmap.uv_faces[start[i] : start[i + 1]].ravel() for i in mine])
        split = split_vertices(pool.count, corners, stored, uv_of)
        sources.append(pool.first + split.source)
        users = [primitives[i] for i in mine]
        dropped += edit.pool(users, pool, split, file_uv(split.uv), number)
        if edit.new_tangents is not None:
            own_tangents = [edit.new_tangents[start[i] : start[i + 1]].reshape(-1, 4) for i in mine]
            edit.tangents(users, split, np.concatenate(own_tangents))
        if split.added:
            added += split.added
            listed += edit.relist(users, split)
    notes = []
    if added:
        notes.append(duplicated(added))
    if listed:
        notes.append(
            f"{counted(listed, 'strip or fan primitive')} made triangle lists: a seam runs through"
        )
    if dropped:
        of = counted(dropped, "primitive")
        notes.append(f"tangents of {of} were dropped: they belonged to the old uv")
    blocks = join_primitives(edit, primitives, edit.merged)
    joined = sum(len(block) for block in blocks if len(block) > 1)
    if joined:
        left = joined - len(primitives) + len(blocks)
        notes.append(
            f"{counted(joined, 'primitive')} joined into {left}: their materials are one now"
        )
    data, extra, assets = edit.finish(format, stem)
    order = [i for block in blocks for i in block]
    faces = np.concatenate([np.arange(start[i], start[i + 1]) for i in order])
    vertices = np.concatenate([sources[k] for k in _pool_order(blocks, primitives, len(pools))])
    return Encoded(data, format, vertices, faces, extra, assets, notes)


def _pool_order(blocks: list[list[int]], primitives: list[Primitive], n: int) -> list[int]:
    """The pools in the order in which they are read where primitives are joined in blocks."""
    place = np.arange(n)
    for block in blocks:
        own = sorted({primitives[i].pool for i in block})
        place[own] = place[own[0]]
    return np.argsort(place, kind="stable").tolist()


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
        lost = "TANGENT" in attributes and any(
            tangent_set(self.json, e) in changed for e in entries
        )
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
        """Let the materials show carried images in place of theirs."""
        entries = [(p, p.entry(self.json)) for p in primitives]
        default = len(self.json.get("materials", []))
        self.keeps = frozenset(
            (p.mesh, p.number) for p, e in entries if e.get("material", default) in carried.kept
        )
        sets = [int(k[9:]) for _, e in entries for k in e["attributes"] if k[:9] == "TEXCOORD_"]
        self.kept_set = max([carried.uv_set, *sets]) + 1
        self.json, pages = redressed(self.json, primitives, carried, self.kept_set)
        self.images = {number: carried.pages[page] for number, page in pages.items()}
        self.image_files = carried.files or {}
        self.new_tangents = carried.tangents
        one = {k for group in carried.groups if len(group.members) > 1 for k in group.members}
        self.merged = [k for k, (_, e) in enumerate(entries) if e.get("material", default) in one]

    def tangents(self, users: list[Primitive], split: Split, new_tangents: FloatArray) -> None:
        """TANGENT of primitives with normals: those of corners (c, 4) in the world; the last of a vertex
        counts."""
        entries = [p.entry(self.json) for p in users]
        kept = any((p.mesh, p.number) in self.keeps for p in users)
        if kept or not all("NORMAL" in entry["attributes"] for entry in entries):
            return
        whole = mesh_matrices(self.tree)[users[0].mesh][:3, :3]
        local = unit_rows(times(new_tangents[:, :3], np.linalg.pinv(whole).T))
        rows = np.tile([1.0, 0.0, 0.0, 1.0], (len(split.source), 1))
        rows[split.corner] = np.c_[local, new_tangents[:, 3]]
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


def tangent_set(tree: Json, entry: Json) -> int:
    """The uv set that tangents of a primitive belong to: that of its normal map."""
    material = tree["materials"][entry["material"]] if "material" in entry else {}
    texture = material.get("normalTexture", {})
    moved = texture.get("extensions", {}).get("KHR_texture_transform", {})
    return int(moved.get("texCoord", texture.get("texCoord", 0)))
