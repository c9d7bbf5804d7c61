"""Unused entries of a glTF tree: accessors, views and buffers that lost their last user are removed.

New entries take the places of removed ones, so few numbers change. The remaining gaps are closed and all
references renumbered. The bytes go with them, those of accessors that share a view with others too.
"""

from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import BoolArray
from circparam.formats.gltf.model import Json
from circparam.formats.gltf.reading import element_size

_DATA_KEYS = {"accessor", "accessors", "bufferView", "buffer", "attributes", "indices", "POSITION"}
Slots: TypeAlias = Iterable[tuple[Any, Any]]


@dataclass(frozen=True)
class Span:
    """Bytes ``start`` to ``end`` of a buffer."""

    buffer: int
    start: int
    end: int


@dataclass(frozen=True)
class Unused:
    """Removed data: the bytes, and the views in which other accessors still live (by identity)."""

    spans: list[Span]
    shared: list[Json]


def accessor_slots(tree: Json) -> Slots:
    """(container, key) of every reference to an accessor."""
    for mesh in tree.get("meshes", []):
        for p in mesh["primitives"]:
            yield from ((p["attributes"], k) for k in p["attributes"])
            yield from ((t, k) for t in p.get("targets", []) for k in t)
            if "indices" in p:
                yield p, "indices"
    for animation in tree.get("animations", []):
        yield from ((s, k) for s in animation["samplers"] for k in ("input", "output"))
    for skin in tree.get("skins", []):
        if "inverseBindMatrices" in skin:
            yield skin, "inverseBindMatrices"


def view_slots(tree: Json) -> Slots:
    """(container, key) of every reference to a buffer view."""
    for accessor in tree.get("accessors", []):
        yield from ((x, "bufferView") for x in _parts(accessor))
    yield from ((i, "bufferView") for i in tree.get("images", []) if "bufferView" in i)


def used_accessors(tree: Json) -> set[int]:
    """The accessors that something refers to."""
    return {container[key] for container, key in accessor_slots(tree)}


def drop_unused(
    tree: Json, gone: Iterable[int], accessors: int, views: int, others: Iterable[int]
) -> Unused:
    """Take out the accessors ``gone``, and the views that only they used.

    accessors, views: their numbers before new ones were appended. others: further views without a use, of
    images that went and of compressed copies. Entries that nothing used at first stay, because they belong to
    the file.
    """
    old, all_views = tree.get("accessors", []), tree.get("bufferViews", [])
    free = sorted(gone)
    mine = views_of(old, free) | set(others)
    kept = set(range(len(old))) - set(free)
    alive = views_of(old, kept) | {i.get("bufferView") for i in tree.get("images", [])}
    dead = sorted(mine - alive)
    spans = [view_span(all_views[k]) for k in dead]
    spans += [s for k in free for s in accessor_spans(tree, old[k])]
    shared = [all_views[k] for k in sorted(mine & alive)]
    _fill_gaps(old, free, accessors, lambda: accessor_slots(tree))
    _fill_gaps(all_views, dead, views, lambda: view_slots(tree))
    return Unused(spans, shared)


def drop_buffers(tree: Json, before: Json, fresh: Iterable[Json]) -> None:
    """Take out the buffers that views used ``before`` and none but ``fresh`` ones use now, in place."""
    new = {id(v) for v in fresh}
    kept_views = [v for v in tree.get("bufferViews", []) if id(v) not in new]
    gone = {v["buffer"] for v in before.get("bufferViews", [])} - {v["buffer"] for v in kept_views}
    close_gaps(tree["buffers"], gone, ((view, "buffer") for view in kept_views))


def row_span(view: Json, accessor: Json) -> tuple[int, int]:
    """(start, end) of the bytes of an accessor in its view, by whole rows where the view interleaves."""
    size = element_size(accessor)
    stride, start = view.get("byteStride", 0) or size, accessor.get("byteOffset", 0)
    count = int(accessor["count"])
    if stride == size:
        return start, start + count * size
    first = start - start % stride
    return first, max(first + count * stride, start + max(count - 1, 0) * stride + size)


def short_views(tree: Json) -> dict[int, int]:
    """View → its length in whole rows, for every view that ends inside the last row of an accessor.

    glTF allows such views. Loaders take count × stride bytes, three.js and assimp among them, and refuse them.
    """
    views = tree.get("bufferViews", [])
    need: dict[int, int] = {}
    for a in tree.get("accessors", []):
        k = a.get("bufferView", -1)
        if 0 <= k < len(views) and (stride := views[k].get("byteStride", 0)):
            end = row_span(views[k], a)[1]
            if 0 < end - views[k]["byteLength"] < stride:
                need[k] = max(need.get(k, 0), end)
    return need


def accessor_spans(tree: Json, accessor: Json) -> list[Span]:
    """The bytes of an accessor by whole rows, its sparse parts by whole views; padding to a word counts in."""
    views = tree.get("bufferViews", [])
    out = [view_span(views[x["bufferView"]]) for x in _parts(accessor) if x is not accessor]
    if "bufferView" in accessor:
        view = view_span(views[accessor["bufferView"]])
        start, end = (view.start + x for x in row_span(views[accessor["bufferView"]], accessor))
        out.append(Span(view.buffer, start, min(end + -end % 4, view.end)))
    return out


def cut(tree: Json, body: bytes, unused: Unused, fresh: Iterable[Json]) -> bytes:
    """Buffer 0 without the bytes that went, unless others lie over them; offsets follow, in place.

    fresh: views that have no bytes yet. Whole words go, so that everything behind them stays aligned.
    """
    shared, new = {id(v) for v in unused.shared}, {id(v) for v in fresh}
    views = tree.get("bufferViews", [])
    old = [v for v in views if id(v) not in new and v["buffer"] == 0]
    images = {i["bufferView"] for i in tree.get("images", []) if "bufferView" in i}
    live = [
        view_span(v)
        for k, v in enumerate(views)
        if id(v) not in new and (k in images or id(v) not in shared)
    ]
    inside = [
        a for a in tree.get("accessors", [])
        if any(id(views[x["bufferView"]]) in shared for x in _parts(a))
    ]  # fmt: skip
    live += [span for a in inside for span in accessor_spans(tree, a)]
    drop = _words(unused.spans, len(body), whole=True) & ~_words(live, len(body), whole=False)
    gone = np.concatenate([[0], 4 * np.cumsum(drop)])

    def before(place: int) -> int:
        """How many bytes go that lie before a place."""
        word, rest = divmod(place, 4)
        return int(gone[word]) + (rest if rest and drop[word] else 0)

    for a in inside:
        view = views[a["bufferView"]] if "bufferView" in a else None
        if view is not None and a.get("byteOffset", 0):
            start = view.get("byteOffset", 0)
            a["byteOffset"] -= before(start + a["byteOffset"]) - before(start)
    for v in old:
        start, size = v.get("byteOffset", 0), v["byteLength"]
        if before(start):
            v["byteOffset"] = start - before(start)
        v["byteLength"] = size - (before(start + size) - before(start))
    spare = -len(body) % 4
    kept = np.frombuffer(body + bytes(spare), np.uint32)[~drop].tobytes()
    return kept[: len(kept) - spare] if spare and not drop[-1] else kept


def extensions_hold_data(tree: Any) -> bool:
    """Whether an extension refers to accessors, views or buffers by itself (then nothing may be renumbered)."""
    stack = [(tree, False)]
    while stack:
        value, inside = stack.pop()
        if isinstance(value, dict):
            if inside and _DATA_KEYS & set(value):
                return True
            stack += [(v, inside or k == "extensions") for k, v in value.items()]
        elif isinstance(value, list):
            stack += [(v, inside) for v in value]
    return False


def _parts(accessor: Json) -> list[Json]:
    """The objects of an accessor that name a view: itself, and its sparse parts."""
    sparse = accessor.get("sparse", {})
    parts = (accessor, sparse.get("indices", {}), sparse.get("values", {}))
    return [x for x in parts if "bufferView" in x]


def views_of(accessors: list[Json], numbers: Iterable[int]) -> set[int]:
    """The views that some accessors name."""
    return {x["bufferView"] for k in numbers for x in _parts(accessors[k])}


def view_span(view: Json) -> Span:
    """The bytes of a view."""
    start = int(view.get("byteOffset", 0))
    return Span(int(view["buffer"]), start, start + int(view["byteLength"]))


def _words(spans: Iterable[Span], size: int, whole: bool) -> BoolArray:
    """(⌈size / 4⌉,) which words of buffer 0, of so many bytes, the spans touch, or (whole) cover."""
    words = -(-size // 4)
    change = np.zeros(words + 1, np.int64)
    mine = sorted((s.start, s.end) for s in spans if s.buffer == 0 and s.end > s.start)
    start, end = np.array(mine, np.int64).reshape(-1, 2).T
    end = np.maximum.accumulate(end)
    first = np.flatnonzero(start > np.concatenate([[-1], end[:-1]]))  # spans that overlap are one
    start, end = start[first], end[np.append(first[1:], len(end))[: len(first)] - 1]
    if whole:
        low, high = -(-start // 4), np.where(end < size, end // 4, words)
    else:
        low, high = start // 4, -(-end // 4)
    some = low < high
    np.add.at(change, np.minimum(low[some], words), 1)
    np.add.at(change, np.minimum(high[some], words), -1)
    return np.cumsum(change)[:-1] > 0


def close_gaps(entries: list[Json], gone: Iterable[int], slots: Slots) -> dict[int, int]:
    """Take entries out of a list, in place; references follow. Returns the new numbers of the others."""
    dead, references = set(gone), list(slots)
    kept = [k for k in range(len(entries)) if k not in dead]
    number = {k: i for i, k in enumerate(kept)}
    for container, key in references:
        container[key] = number.get(container[key], container[key])
    entries[:] = [entries[k] for k in kept]
    return number


def _fill_gaps(entries: list[Json], free: list[int], old: int, slots: Callable[[], Slots]) -> None:
    """Move the entries from ``old`` on into free places, and close the gaps that are left."""
    moves = dict(zip(range(old, len(entries)), free, strict=False))
    for source, place in moves.items():
        entries[place] = entries[source]
    for container, key in slots():
        container[key] = moves.get(container[key], container[key])
    close_gaps(entries, {*moves, *free[len(moves) :]}, slots())
