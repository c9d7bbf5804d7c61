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
from circparam.formats.gltf.model import COMPONENTS, TRIANGLES, Json, Primitive


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
