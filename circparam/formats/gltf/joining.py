"""Primitives of one mesh that show the same material now become one: fewer draw calls, the same vertices.

Attributes, types, morph targets and extras have to be alike. Vertices that other primitives use too stay,
unless all joined primitives share them.
"""

import json
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from circparam.formats.gltf.buffers import Packing
from circparam.formats.gltf.model import (
    ARRAY_BUFFER,
    COMPONENTS,
    ELEMENT_BUFFER,
    TRIANGLES,
    Json,
    Primitive,
    index_type,
)
from circparam.formats.gltf.reading import element_size
from circparam.formats.gltf.unused import Slots, accessor_slots, view_slots
from circparam.formats.tokens import ByteArray


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
        entry = _entry(edit, primitives[i])
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
    _remove(edit, [primitives[i] for i in gone])
    _drop_new(edit)
    return [blocks.get(i, [i]) for i in range(len(primitives)) if i not in gone]


def _entry(edit: Packing, p: Primitive) -> Json:
    entry: Json = edit.json["meshes"][p.mesh]["primitives"][p.number]
    return entry


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
    entries = [_entry(edit, p) for p in group]
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
    corner = np.concatenate(index)
    kinds = [
        edit.json["accessors"][e["indices"]]["componentType"] for e in entries if "indices" in e
    ]
    edit.touched |= {e["indices"] for e in entries if "indices" in e}
    kind = index_type(sum(size), max(kinds, default=5123))
    raw = corner.astype(COMPONENTS[kind])
    head["indices"] = edit.accessor(
        {"componentType": kind, "type": "SCALAR"},
        raw.view(np.uint8).reshape(len(raw), -1),
        ELEMENT_BUFFER,
    )


def _index(edit: Packing, entry: Json, start: int) -> Any:
    """(c,) the vertices of a primitive, counted from ``start``."""
    if "indices" not in entry:
        count = edit.json["accessors"][entry["attributes"]["POSITION"]]["count"]
        return np.arange(count - count % 3) + start
    accessor = edit.json["accessors"][entry["indices"]]
    kind = COMPONENTS[accessor["componentType"]]
    index = np.ascontiguousarray(_rows(edit, entry["indices"])).view(kind)[:, 0].astype(np.int64)
    return index[: len(index) - len(index) % 3] + start


def _concatenated(edit: Packing, numbers: tuple[int, ...]) -> int:
    """A new accessor with the rows of several, one after the other."""
    entries = [edit.json["accessors"][k] for k in numbers]
    edit.touched |= set(numbers)
    keys = ("componentType", "type", "normalized")
    entry = {key: entries[0][key] for key in keys if key in entries[0]}
    for key, best in (("min", np.min), ("max", np.max)):
        if all(key in e for e in entries):
            entry[key] = best([e[key] for e in entries], axis=0).tolist()
    return edit.accessor(entry, np.concatenate([_rows(edit, k) for k in numbers]), ARRAY_BUFFER)


def _rows(edit: Packing, number: int) -> ByteArray:
    """(count, bytes of one element) the raw elements of an accessor, old or new."""
    if number < len(edit.tree.json["accessors"]):
        return edit.tree.rows(number)
    accessor = edit.json["accessors"][number]
    view = edit.json["bufferViews"][accessor["bufferView"]]
    body = next(data for held, data in edit.data if held is view)
    table = np.frombuffer(body, np.uint8).reshape(accessor["count"], -1)
    return table[:, : element_size(accessor)]


def _remove(edit: Packing, primitives: list[Primitive]) -> None:
    """Take primitives out of their meshes; their accessors lose a user."""
    gone = {id(_entry(edit, p)) for p in primitives}
    for p in primitives:
        entry = _entry(edit, p)
        for holder in (entry["attributes"], *entry.get("targets", [])):
            edit.touched |= set(holder.values())
    for mesh in edit.json["meshes"]:
        mesh["primitives"] = [e for e in mesh["primitives"] if id(e) not in gone]


def _drop_new(edit: Packing) -> None:
    """Take out new accessors without users, with their views and bytes."""
    accessors, views = edit.json["accessors"], edit.json["bufferViews"]
    used = {container[key] for container, key in accessor_slots(edit.json)}
    old = len(edit.tree.json["accessors"])
    dead = set(range(old, len(accessors))) - used
    edit.touched = {k for k in edit.touched if k < old}
    if not dead:
        return
    dead_views = {accessors[k]["bufferView"] for k in dead}
    without = {id(views[k]) for k in dead_views}
    edit.data = [(view, body) for view, body in edit.data if id(view) not in without]
    _renumber(accessors, dead, accessor_slots(edit.json))
    _renumber(views, dead_views, view_slots(edit.json))


def _renumber(entries: list[Json], dead: set[int], slots: Slots) -> None:
    """Take entries out of a list, in place; references to the others follow."""
    kept = [k for k in range(len(entries)) if k not in dead]
    number = {k: i for i, k in enumerate(kept)}
    references = list(slots)
    entries[:] = [entries[k] for k in kept]
    for container, key in references:
        container[key] = number.get(container[key], container[key])
